//! Which loops agree with each other and with odometry.

mod groups;
mod growth;
mod uncertain;

use groups::{Chain, Groups};
use growth::grow;
use super::edge::Edge;
use super::loss::Loss;
use super::solver::{ITERATIONS_MAX, Report, Term, solve};
use super::Error;
use randt_geometry::Pose2;

/// What a re-check found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recheck {
    /// The optimisation over the loops that agree.
    pub report: Report,
    /// Loops that agree.
    pub on: usize,
    /// Loops switched off.
    pub off: usize,
    /// Variance of the errors relative to what the edges claim.
    pub noise: f64,
}

/// The verdict.
pub(super) struct Judged {
    pub poses: Vec<Pose2>,
    pub on: Vec<bool>,
    pub noise: f64,
}

/// Judges.
pub(super) fn judge(
    poses: &[Pose2],
    odometry: &[Edge],
    loops: &[&Edge],
) -> Result<Judged, Error> {
    let mut odometry = odometry.to_vec();
    odometry.sort_by_key(|edge| edge.to.max(edge.from));
    // Every loop from the earlier node to the later one, in the order of the later.
    let mut order: Vec<usize> = (0..loops.len()).collect();
    let late = |l: &usize| (loops[*l].from.max(loops[*l].to), loops[*l].from.min(loops[*l].to));
    order.sort_by_key(late);
    let sorted: Vec<Edge> = order.iter().map(|l| forward(loops[*l])).collect();
    let chain = Chain::new(poses.len(), &odometry);
    let t = std::time::Instant::now();
    let groups = Groups::new(&chain, &sorted);
    let v = std::env::var("V").is_ok();
    if v { eprintln!("noise {:.4} groups {} of {} {:?}", groups.noise, groups.groups.len(), sorted.len(), t.elapsed()); }
    let (mut poses, agreed) = grow(poses, &odometry, &sorted, &chain, &groups)?;
    let terms: Vec<Term<'_>> = odometry.iter().chain(sorted.iter().zip(&agreed).filter(|(_, on)| **on).map(|(e, _)| e)).map(|e| (e, Loss::QUADRATIC)).collect();
    let r = solve(&mut None, &mut poses, &terms, ITERATIONS_MAX)?;
    if v {
        eprintln!("{r:?}");
        for g in &groups.groups {
            let o = g.iter().any(|l| agreed[*l]);
            let f = g.iter().filter(|l| order[**l] >= 1954).count();
            let m = &sorted[g[g.len()/2]];
            if f > 0 && o || (f == 0 && !o) || g.len() > 2 && !o { eprintln!("group of {} at {} {}: on {o}, false {f}, chi2 {:.2}", g.len(), m.from, m.to, m.chi2(&poses[m.from], &poses[m.to])); }
        }
    }
    let mut on = vec![false; loops.len()];
    for (l, agreed) in order.iter().zip(&agreed) {
        on[*l] = *agreed;
    }
    Ok(Judged { poses, on, noise: groups.noise })
}

/// The same edge from its earlier node to its later one.
fn forward(edge: &Edge) -> Edge {
    if edge.from < edge.to {
        return edge.clone();
    }
    let carry = edge.measured.inverse().adjoint();
    Edge {
        from: edge.to,
        to: edge.from,
        measured: edge.measured.inverse(),
        information: carry.transpose() * edge.information * carry,
    }
}

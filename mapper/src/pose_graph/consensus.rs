//! Which loops agree with each other and with odometry.
//!
//! Starting a robust solver from odometry that has drifted by metres lets false loops bend the map
//! before the true ones count, and the more where false ones agree with each other. Instead the
//! drive is grown anew from its beginning: at every moment only the drift since the last loops is
//! open, and a loop must lie within it.
//!
//! 1. Components whose odometry is separate are connected only by loops that agree in their
//!    majority.
//! 2. Loops that agree on the same two stretches form a cluster (pairwise consistency, Mangelson
//!    et al. 2018, by short cycles only). Ten loops of one mistake are one support, not ten.
//! 3. Group by cluster, in the order in which they came, the innovation is held against its
//!    covariance. A loop alone waits where its gate is so wide that false ones lie in it by chance.
//! 4. The innovations also show how large errors really are, compared with what the edges claim.
//! 5. Clusters that were turned away may be reinstated once everything is known, by truncated
//!    least squares (as in Yang et al. 2020), and single loops by their innovation then.
//!
//! Not responsible for the weights between re-checks.

mod chance;
mod clusters;
mod consistency;
mod growth;
mod membership;
#[cfg(test)]
mod tests;
mod uncertain;

use super::Error;
use super::edge::Edge;
use super::solver::Report;
use clusters::{GATE, OdometryChain, clusters};
use consistency::{ConsensusResult, Problem};
use growth::{Noise, grow};
use membership::{Membership, memberships};
use randt_geometry::Pose2;
pub(super) use uncertain::Uncertain;

/// Share of the loops that cycles may turn away against the claims before the claims are tried as
/// well.
const CLAIMABLE_MAX: f64 = 0.05;

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

/// What was found of all loops.
#[derive(Default)]
pub(super) struct Judged {
    pub poses: Vec<Pose2>,
    /// For every loop whether it agrees.
    pub on: Vec<bool>,
    pub noise: f64,
}

/// Judges all loops. Of the poses only the first of every stretch of odometry counts.
pub(super) fn judge(poses: &[Pose2], odometry: &[Edge], loops: &[&Edge]) -> Result<Judged, Error> {
    let mut odometry: Vec<Edge> = odometry.iter().map(Edge::forward).collect();
    odometry.sort_by_key(|edge| edge.to);
    let chain = OdometryChain::new(poses.len(), &odometry);
    let forward: Vec<Edge> = loops.iter().map(|edge| edge.forward()).collect();
    let mut order: Vec<usize> = (0..loops.len()).collect();
    order.sort_by_key(|l| (forward[*l].to, forward[*l].from));
    let arriving =
        |order: &[usize]| -> Vec<Edge> { order.iter().map(|l| forward[*l].clone()).collect() };
    let memberships = memberships(poses.len(), &odometry, &chain, &arriving(&order));
    let (order, connects): (Vec<usize>, Vec<bool>) = (order.into_iter().zip(memberships))
        .filter(|(_, membership)| *membership != Membership::Excluded)
        .map(|(l, membership)| (l, membership == Membership::Connects))
        .unzip();
    let arriving = arriving(&order);

    let (clusters, cycles) = clusters(&chain, &arriving);
    // Short cycles show the noise but not the drift; innovations show both but believe the first
    // loops. Where they differ both are tried, and the data choose.
    let mut best: Option<(f64, Problem<'_>, ConsensusResult)> = None;
    for noise in [Noise::Fixed(cycles), Noise::CLAIMED] {
        let grown = grow(
            poses, &odometry, &arriving, &chain, &clusters, &connects, noise,
        )?;
        let problem = Problem {
            odometry: &odometry,
            loops: &arriving,
            gate: GATE * grown.noise,
        };
        let doubtful = grown.claimable as f64 > CLAIMABLE_MAX * loops.len() as f64;
        let result = problem.solve_truncated(grown.poses, grown.on)?;
        let cost = problem.deviance(&result);
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, problem, result));
        }
        if !doubtful {
            break;
        }
    }
    let Some((_, problem, result)) = best else {
        return Ok(Judged::default());
    };
    let noise = problem.gate / GATE;
    let result = problem.readmit(problem.reinstate(&clusters, result)?)?;

    let mut on = vec![false; loops.len()];
    for (l, agrees) in order.iter().zip(&result.on) {
        on[*l] = *agrees;
    }
    Ok(Judged {
        poses: result.poses,
        on,
        noise,
    })
}

//! Which loops agree with each other and with odometry.

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
    let c2: f64 = std::env::var("C2").ok().and_then(|v| v.parse().ok()).unwrap_or(11.3);
    let mut poses = poses.to_vec();
    let mut system = None;
    let terms = |weights: &[f64]| -> Vec<Term<'_>> {
        odometry.iter().map(|e| (e, Loss::QUADRATIC))
            .chain(loops.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(e, w)| (*e, Loss::Weighted(*w))))
            .collect()
    };
    let mut weights = vec![1.0; loops.len()];
    let begin = std::time::Instant::now();
    let report = solve(&mut system, &mut poses, &terms(&weights), 30)?;
    eprintln!("initial {report:?} {:?}", begin.elapsed());
    let chi2 = |poses: &[Pose2]| -> Vec<f64> { loops.iter().map(|e| e.chi2(&poses[e.from], &poses[e.to])).collect() };
    let max = chi2(&poses).into_iter().fold(0.0, f64::max);
    let mut mu = c2 / (2.0 * max - c2).max(1e-9);
    let mut rounds = 0;
    while mu < 1e4 && rounds < 200 {
        rounds += 1;
        for (w, r2) in weights.iter_mut().zip(chi2(&poses)) {
            *w = if r2 <= mu / (mu + 1.0) * c2 { 1.0 } else if r2 >= (mu + 1.0) / mu * c2 { 0.0 } else { (c2 * mu * (mu + 1.0) / r2).sqrt() - mu };
        }
        let r = solve(&mut system, &mut poses, &terms(&weights), 2)?;
        if std::env::var("V").is_ok() { eprintln!("mu {mu:.3e} chi2 {:.2} step {:.2e} on {}", r.chi2, r.step, weights.iter().filter(|w| **w > 0.5).count()); }
        if weights.iter().all(|w| *w == 0.0 || *w == 1.0) && r.step < 1e-6 && rounds > 5 { break; }
        mu *= 1.4;
    }
    eprintln!("gnc {rounds} {:?}", begin.elapsed());
    solve(&mut system, &mut poses, &terms(&weights), ITERATIONS_MAX)?;
    Ok(Judged { poses, on: weights.iter().map(|w| *w > 0.5).collect(), noise: 1.0 })
}

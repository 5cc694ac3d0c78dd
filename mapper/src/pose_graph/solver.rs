//! Gauss-Newton on the poses of a graph; damped only where a step fails.

use super::Error;
use super::chordal::chordal;
use super::edge::{Edge, moved};
use super::loss::Loss;
use super::system::System;
use randt_geometry::Pose2;

/// Steps below this that shrink no more are the rounding of long chains, not descent.
const STEP_ROUNDING: f64 = 1e-6;
/// First damping after a failed step, relative to the diagonal, its growth, and where it is
/// hopeless.
const DAMPING_FIRST: f64 = 1e-6;
const DAMPING_GROWTH: f64 = 10.0;
const DAMPING_MAX: f64 = 1e6;
/// A cost may rise by its own rounding.
const COST_ROUNDING: f64 = 1e-12;
/// Another minimum costs less by more than this share: of 41.2, 74.5 and 137.9 those beside them
/// cost 770, 755 and as much again; the same one from two starts differs in the tenth digit.
const OTHER_MINIMUM: f64 = 1e-6;

/// How far to go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Largest step, m and rad, at which it is good.
    pub step: f64,
    /// Factorisations, those of damped steps included.
    pub factorisations_max: usize,
}

impl Effort {
    /// To the optimum: machines with and without FMA then agree to 1e-6 m. Gauss-Newton takes 3 to
    /// 8 steps, from far away or with robust weights some tens; more is no descent.
    pub const FULL: Self = Self {
        step: 1e-9,
        factorisations_max: 100,
    };

    /// While loops still come, a millimetre at a time: Gauss-Newton leaves less than a hundredth
    /// of its last step, and a loop is good for centimetres.
    pub const WARM: Self = Self {
        step: 1e-3,
        ..Self::FULL
    };
}

/// Where a solution began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// Where the poses were.
    #[default]
    Estimate,
    /// At the chordal relaxation of the edges.
    Chordal,
}

/// How a solution was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Where it began.
    pub start: Start,
    /// Steps taken.
    pub iterations: usize,
    /// Sum of e^T Omega e over all edges that count, weights included.
    pub chi2: f64,
    /// The last step's largest component, m or rad.
    pub step: f64,
    /// Whether the last step was as small as wanted.
    pub converged: bool,
}

/// Edges with their losses.
pub(super) type Term<'a> = (&'a Edge, Loss);

/// Odometry, and the loops that are on, believed in full.
pub(super) fn believed<'a>(odometry: &'a [Edge], loops: &'a [Edge], on: &[bool]) -> Vec<Term<'a>> {
    let loops = loops.iter().zip(on).filter(|(_, on)| **on);
    let edges = odometry.iter().chain(loops.map(|(edge, _)| edge));
    edges.map(|edge| (edge, Loss::QUADRATIC)).collect()
}

/// Moves the poses to the least cost, starting where they are. The system is made anew where it
/// does not fit.
pub(super) fn solve(
    system: &mut Option<System>,
    poses: &mut [Pose2],
    terms: &[Term<'_>],
    effort: Effort,
) -> Result<Report, Error> {
    let system = fitting(system, poses.len(), terms)?;
    let mut damping = 0.0;
    let mut report = Report {
        step: f64::INFINITY,
        chi2: cost(poses, terms),
        ..Report::default()
    };
    build(system, poses, terms);
    let mut factorisations = 0;
    while factorisations < effort.factorisations_max && !report.converged {
        factorisations += 1;
        let mut tried = None;
        if system.factorise(damping) {
            let step = system.step();
            let moved = poses.iter().enumerate().map(|(node, pose)| {
                let own = system.node_step(&step, node);
                own.map_or(*pose, |own| moved(pose, &own))
            });
            let moved: Vec<Pose2> = moved.collect();
            let size = step.iter().fold(0.0_f64, |max, value| max.max(value.abs()));
            let cost = cost(&moved, terms);
            if cost <= report.chi2 * (1.0 + COST_ROUNDING) || size < STEP_ROUNDING {
                tried = Some((moved, size, cost));
            }
        }
        let Some((moved, size, cost)) = tried else {
            damping = (damping * DAMPING_GROWTH).max(DAMPING_FIRST);
            if damping > DAMPING_MAX {
                // No step lowers the cost: a factorisation that never succeeds is an error, a
                // floor is not.
                if !system.factorise(damping) {
                    return Err(Error::Singular {
                        unknowns: system.unknowns(),
                        damping,
                    });
                }
                break;
            }
            continue;
        };
        poses.copy_from_slice(&moved);
        let shrinks = size < 0.5 * report.step;
        report.converged =
            damping == 0.0 && (size < effort.step || (size < STEP_ROUNDING && !shrinks));
        report.iterations += 1;
        (report.step, report.chi2) = (size, cost);
        damping /= DAMPING_GROWTH;
        if damping < DAMPING_FIRST {
            damping = 0.0;
        }
        if !report.converged {
            build(system, poses, terms);
        }
    }
    Ok(report)
}

/// The same from two starts, where the poses are and at their chordal relaxation; the lower
/// minimum is taken.
pub(super) fn solve_anew(
    system: &mut Option<System>,
    poses: &mut [Pose2],
    terms: &[Term<'_>],
    effort: Effort,
) -> Result<Report, Error> {
    let start = chordal(system, poses, terms);
    let report = solve(system, poses, terms, effort);
    let Ok(mut other) = start else {
        return report;
    };
    let Ok(found) = solve(system, &mut other, terms, effort) else {
        return report;
    };
    let is_lower = |report: &Report| found.chi2 < report.chi2 * (1.0 - OTHER_MINIMUM);
    if report.as_ref().is_ok_and(|report| !is_lower(report)) {
        return report;
    }
    poses.copy_from_slice(&other);
    Ok(Report {
        start: Start::Chordal,
        ..found
    })
}

/// The equations of these terms, factorised at these poses or, where they are solved, a last step
/// away from them.
pub(super) fn factorised<'a>(
    system: &'a mut Option<System>,
    poses: &[Pose2],
    terms: &[Term<'_>],
) -> Result<&'a mut System, Error> {
    let system = fitting(system, poses.len(), terms)?;
    if !system.factorised {
        build(system, poses, terms);
        if !system.factorise(0.0) {
            return Err(Error::Singular {
                unknowns: system.unknowns(),
                damping: 0.0,
            });
        }
    }
    Ok(system)
}

/// The system of these terms: the one that is there, or where that does not fit a new one in its
/// place.
pub(super) fn fitting<'a>(
    system: &'a mut Option<System>,
    nodes: usize,
    terms: &[Term<'_>],
) -> Result<&'a mut System, Error> {
    let pairs = || terms.iter().map(|(edge, _)| (edge.from.0, edge.to.0));
    let old = system.take();
    let factorisations = old.as_ref().map_or(0, |old| old.factorisations);
    Ok(match old {
        Some(fits) if fits.fits(nodes, pairs()) => system.insert(fits),
        _ => {
            let new = system.insert(System::new(nodes, pairs().collect())?);
            new.factorisations = factorisations;
            new
        }
    })
}

fn cost(poses: &[Pose2], terms: &[Term<'_>]) -> f64 {
    let costs = terms.iter().map(|(edge, loss)| loss.cost(edge.chi2(poses)));
    costs.sum()
}

fn build(system: &mut System, poses: &[Pose2], terms: &[Term<'_>]) {
    system.clear();
    for (index, (edge, loss)) in terms.iter().enumerate() {
        let (from, to) = (&poses[edge.from.0], &poses[edge.to.0]);
        let error = edge.error(from, to);
        let weight = loss.weight(error.dot(&(edge.information * error)));
        let information = edge.information * weight;
        system.add(index, &error, &edge.derivatives(from, to), &information);
    }
}

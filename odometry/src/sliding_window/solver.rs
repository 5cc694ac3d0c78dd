//! Least squares over the last l scans (RaNDT, III-C): motion model, gyro and NDT terms under an
//! adaptive loss whose scale is graduated; associations are made again at each graduation step.

use super::{
    block_tridiagonal::BlockTridiagonalSystem,
    factors, ndt_term,
    prior::Prior,
    state::{State, StateMatrix, StateVector},
    window_scan::WindowScan,
};
use crate::submaps::Submap;
use nalgebra::Matrix3;
use randt_config::Config;
use randt_ndt::{AdaptiveLoss, Association};

/// Gauss-Newton steps while the loss is still wide: they only need to lead into the next one's
/// basin.
const ITERATIONS_WIDE: u32 = 2;
/// Gauss-Newton steps under the final loss; most scans need three.
const ITERATIONS_MAX: u32 = 6;
/// A step of every pose below this (m, rad) ends a solve: a thirtieth of a range bin, and far
/// below the centimetre to which one scan fixes a pose.
const STEP_MIN: f64 = 5e-4;
/// Halvings of a step that raises the cost.
const HALVINGS_MAX: u32 = 4;

/// How a solve went.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solution {
    /// Marginal covariance of the newest state.
    pub covariance: StateMatrix,
    /// Information of the newest scan's NDT term about its pose.
    pub scan_information: Matrix3<f64>,
    /// Mean robust weight of the newest scan's correspondences, 0..1.
    pub fit: f64,
    /// Robust cost of the window.
    pub cost: f64,
    /// Gauss-Newton steps taken.
    pub iterations: u32,
}

impl Solution {
    /// Variance of the newest gyro bias, (rad/s)^2.
    pub fn bias_variance(&self) -> f64 {
        self.covariance[(6, 6)]
    }

    /// Largest variance of the newest position in any direction, m^2.
    pub fn position_variance_m2(&self) -> f64 {
        let position = self.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        position.symmetric_eigenvalues().max()
    }
}

/// What a window is solved against.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// What is known from before the window.
    pub prior: &'a Prior,
    /// The map.
    pub submap: &'a Submap,
    /// Whether the window's first scan is the submap itself and has no NDT term.
    pub first_is_map: bool,
    /// Settings.
    pub config: &'a Config,
}

impl Problem<'_> {
    fn loss(&self, mu: f64) -> AdaptiveLoss {
        let odometry = &self.config.odometry;
        AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, mu)
    }

    /// Makes the associations of every scan that has an NDT term.
    fn associate(&self, scans: &mut [WindowScan]) {
        let neighbours = self.config.odometry.neighbours as usize;
        for scan in scans.iter_mut().skip(usize::from(self.first_is_map)) {
            let submap_from_base = self
                .submap
                .odom_from_root
                .between(&scan.state.odom_from_base);
            Association::find(
                &self.submap.grid,
                &scan.cells,
                &submap_from_base,
                neighbours,
                &mut scan.associations,
            );
        }
    }
}

/// Gauss-Newton over a window's scans; reuses its memory.
#[derive(Clone, Debug)]
pub struct Solver {
    system: BlockTridiagonalSystem,
    pair: BlockTridiagonalSystem,
    steps: Vec<StateVector>,
    before: Vec<State>,
}

impl Solver {
    /// Room for a window of `states`.
    pub fn new(states: usize) -> Self {
        let room = states + 1;
        Self {
            system: BlockTridiagonalSystem::new(room),
            pair: BlockTridiagonalSystem::new(2),
            steps: Vec::with_capacity(room),
            before: Vec::with_capacity(room),
        }
    }

    /// Finds the window's most likely states.
    pub fn solve(&mut self, scans: &mut [WindowScan], problem: &Problem) -> Option<Solution> {
        let mut solution = Solution::default();
        for &mu in &problem.config.odometry.graduation {
            let loss = problem.loss(mu);
            problem.associate(scans);
            let iterations = if mu > 1.0 {
                ITERATIONS_WIDE
            } else {
                ITERATIONS_MAX
            };
            solution.cost = self.build(scans, problem, &loss, true);
            for _ in 0..iterations {
                solution.covariance = self.system.solve(&mut self.steps)?;
                solution.iterations += 1;
                let moved = self
                    .steps
                    .iter()
                    .map(|step| step.fixed_rows::<3>(0).amax())
                    .fold(0.0, f64::max);
                if !moved.is_finite() {
                    return None;
                }
                solution.cost = self.descend(scans, problem, &loss, solution.cost);
                if moved < STEP_MIN {
                    break;
                }
            }
        }
        let newest = scans.last()?;
        solution.fit = newest.fit();
        solution.scan_information = newest.scan_information(problem.config);
        Some(solution)
    }

    /// Takes the step that was solved for, halved as long as it raises the cost; gives the new
    /// cost and leaves the system built at the new states.
    fn descend(
        &mut self,
        scans: &mut [WindowScan],
        problem: &Problem,
        loss: &AdaptiveLoss,
        cost: f64,
    ) -> f64 {
        self.before.clear();
        self.before.extend(scans.iter().map(|scan| scan.state));
        let mut scale = 1.0;
        for _ in 0..=HALVINGS_MAX {
            for ((scan, before), step) in scans.iter_mut().zip(&self.before).zip(&self.steps) {
                scan.state = before.plus(&(step * scale));
            }
            let new = self.build(scans, problem, loss, false);
            if new <= cost {
                return new;
            }
            scale *= 0.5;
        }
        // No descent: within rounding this is the optimum.
        for (scan, before) in scans.iter_mut().zip(&self.before) {
            scan.state = *before;
        }
        self.build(scans, problem, loss, false)
    }

    /// Builds the window's normal equations at the present states; gives the cost. Where the
    /// associations are new, directions that a scan does not see are taken out of them.
    fn build(
        &mut self,
        scans: &mut [WindowScan],
        problem: &Problem,
        loss: &AdaptiveLoss,
        are_associations_new: bool,
    ) -> f64 {
        let system = &mut self.system;
        system.reset(scans.len());
        let mut cost = scans
            .first()
            .map_or(0.0, |first| problem.prior.add(system, &first.state));
        let mut previous: Option<State> = None;
        for (i, scan) in scans.iter_mut().enumerate() {
            if let Some(previous) = previous {
                cost += factors::add(system, i, &previous, scan, &problem.config.odometry);
            }
            if i > 0 || !problem.first_is_map {
                scan.ndt = ndt_term::evaluate_scan(scan, problem.submap, loss);
                if are_associations_new {
                    ndt_term::ignore_unseen(scan, previous.as_ref(), problem, loss);
                }
                cost += ndt_term::add(system, i, scan, problem.config);
            }
            previous = Some(scan.state);
        }
        cost
    }

    /// Marginalises the oldest state: gives the prior of the second one.
    ///
    /// The oldest scan's NDT term is the one of the last solve.
    pub fn marginalize_oldest(
        &mut self,
        oldest: &WindowScan,
        second: &WindowScan,
        problem: &Problem,
    ) -> Option<Prior> {
        let system = &mut self.pair;
        system.reset(2);
        problem.prior.add(system, &oldest.state);
        if !problem.first_is_map {
            ndt_term::add(system, 0, oldest, problem.config);
        }
        factors::add(system, 1, &oldest.state, second, &problem.config.odometry);
        let (information, gradient) = system.marginal_of_second()?;
        let step = information.cholesky()?.solve(&-gradient);
        Some(Prior {
            mean: second.state.plus(&step),
            information,
        })
    }
}

//! Least squares over the last l scans (paper, III-C): motion model, gyro and NDT terms under an adaptive
//! loss whose scale is graduated; associations are made again at each graduation step.

use crate::{
    chain::Chain,
    factors, ndt_term,
    slot::Slot,
    state::{State, StateMatrix, StateVector},
    submap::Submap,
};
use nalgebra::Matrix3;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{AdaptiveLoss, Association};
use randt_persist::persist;

/// Gauss-Newton steps while the loss is still wide: they only need to lead into the next one's basin.
const ITERATIONS_WIDE: u32 = 2;
/// Gauss-Newton steps under the final loss; most scans need three.
const ITERATIONS_MAX: u32 = 6;
/// A step of every pose below this (m, rad) ends a solve: a thirtieth of a range bin, and next to the centimetre that
/// one scan fixes a pose to nothing.
const STEP_MIN: f64 = 5e-4;
/// Halvings of a step that raises the cost.
const HALVINGS_MAX: u32 = 4;

/// What is known of the oldest state of the window from all that lies before it.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// Most likely state.
    pub mean: State,
    /// Its information.
    pub information: StateMatrix,
}

persist!(Prior { mean, information });

impl Prior {
    /// Adds the prior to the first state of a chain; gives its cost.
    fn add(&self, chain: &mut Chain, state: &State) -> f64 {
        let residual = state.minus(&self.mean);
        let mut jacobian = StateMatrix::identity();
        let pose = Pose2::right_jacobian_inverse(residual.fixed_rows::<3>(0).into_owned());
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose);
        let weighted = self.information * residual;
        chain.add_unary(
            0,
            &(jacobian.transpose() * self.information * jacobian),
            &(jacobian.transpose() * weighted),
        );
        0.5 * residual.dot(&weighted)
    }
}

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

/// What a window is solved against.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// What lies before the window.
    pub prior: &'a Prior,
    /// The map.
    pub submap: &'a Submap,
    /// Whether the window's first scan is the map itself and has no NDT term.
    pub seeded: bool,
    /// Settings.
    pub config: &'a Config,
}

impl Problem<'_> {
    fn loss(&self, mu: f64) -> AdaptiveLoss {
        let odometry = &self.config.odometry;
        AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, mu)
    }

    /// Makes the associations of every scan that has an NDT term.
    fn associate(&self, slots: &mut [Slot]) {
        let neighbours = self.config.odometry.neighbours as usize;
        for slot in slots.iter_mut().skip(usize::from(self.seeded)) {
            let pose = self.submap.root.between(&slot.state.pose);
            Association::find(
                &self.submap.grid,
                &slot.cells,
                &pose,
                neighbours,
                &mut slot.associations,
            );
        }
    }
}

/// The solver's memory.
#[derive(Clone, Debug)]
pub struct Solver {
    chain: Chain,
    pair: Chain,
    steps: Vec<StateVector>,
    before: Vec<State>,
}

impl Solver {
    /// Room for a window of `states`.
    pub fn new(states: usize) -> Self {
        let room = states + 1;
        Self {
            chain: Chain::new(room),
            pair: Chain::new(2),
            steps: Vec::with_capacity(room),
            before: Vec::with_capacity(room),
        }
    }

    /// Finds the window's most likely states.
    pub fn solve(&mut self, slots: &mut [Slot], problem: &Problem) -> Option<Solution> {
        let mut solution = Solution::default();
        for &mu in &problem.config.odometry.graduation {
            let loss = problem.loss(mu);
            problem.associate(slots);
            let iterations = if mu > 1.0 {
                ITERATIONS_WIDE
            } else {
                ITERATIONS_MAX
            };
            solution.cost = self.build(slots, problem, &loss);
            for _ in 0..iterations {
                solution.covariance = self.chain.solve(&mut self.steps)?;
                solution.iterations += 1;
                let moved = self
                    .steps
                    .iter()
                    .map(|step| step.fixed_rows::<3>(0).amax())
                    .fold(0.0, f64::max);
                if !moved.is_finite() {
                    return None;
                }
                solution.cost = self.descend(slots, problem, &loss, solution.cost);
                if moved < STEP_MIN {
                    break;
                }
            }
        }
        let newest = slots.last()?;
        let used: usize = newest.associations.iter().map(|a| a.count).sum();
        solution.fit = newest.ndt.weight / used.max(1) as f64;
        solution.scan_information = newest.scan_information(problem.config);
        Some(solution)
    }

    /// Takes the step that was solved for, halved as long as it raises the cost; gives the new cost and leaves the
    /// chain built there.
    fn descend(
        &mut self,
        slots: &mut [Slot],
        problem: &Problem,
        loss: &AdaptiveLoss,
        cost: f64,
    ) -> f64 {
        self.before.clear();
        self.before.extend(slots.iter().map(|slot| slot.state));
        let mut scale = 1.0;
        for _ in 0..=HALVINGS_MAX {
            for ((slot, before), step) in slots.iter_mut().zip(&self.before).zip(&self.steps) {
                slot.state = before.plus(&(step * scale));
            }
            let new = self.build(slots, problem, loss);
            if new <= cost {
                return new;
            }
            scale *= 0.5;
        }
        // No descent: the optimum is here as far as numbers can tell.
        for (slot, before) in slots.iter_mut().zip(&self.before) {
            slot.state = *before;
        }
        self.build(slots, problem, loss)
    }

    /// Builds the window's normal equations at the present states; gives the cost.
    fn build(&mut self, slots: &mut [Slot], problem: &Problem, loss: &AdaptiveLoss) -> f64 {
        let chain = &mut self.chain;
        chain.reset(slots.len());
        let mut cost = slots
            .first()
            .map_or(0.0, |first| problem.prior.add(chain, &first.state));
        let mut previous: Option<State> = None;
        for (i, slot) in slots.iter_mut().enumerate() {
            if let Some(previous) = previous {
                cost += factors::add(chain, i, &previous, slot, &problem.config.odometry);
            }
            if i > 0 || !problem.seeded {
                slot.ndt = ndt_term::of(slot, problem.submap, loss);
                cost += ndt_term::add(chain, i, slot, problem.config);
            }
            previous = Some(slot.state);
        }
        cost
    }

    /// What the oldest scan leaves behind when it goes: the prior of the second.
    ///
    /// The oldest scan's NDT term is the one of the last solve.
    pub fn marginalise(
        &mut self,
        oldest: &Slot,
        second: &Slot,
        problem: &Problem,
    ) -> Option<Prior> {
        let chain = &mut self.pair;
        chain.reset(2);
        problem.prior.add(chain, &oldest.state);
        if !problem.seeded {
            ndt_term::add(chain, 0, oldest, problem.config);
        }
        factors::add(chain, 1, &oldest.state, second, &problem.config.odometry);
        let (information, gradient) = chain.marginal_of_second()?;
        let step = information.cholesky()?.solve(&-gradient);
        Some(Prior {
            mean: second.state.plus(&step),
            information,
        })
    }
}

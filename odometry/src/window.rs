//! Least squares over the last l scans (paper, III-C): motion model, gyro and NDT terms under an adaptive
//! loss whose scale is graduated; associations are made again at each graduation step.

use crate::{
    chain::Chain,
    factors,
    slot::Slot,
    state::{State, StateMatrix, StateVector},
    submap::Submap,
};
use nalgebra::Matrix3;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{AdaptiveLoss, Association, NormalEquations, evaluate};

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

    /// Finds the window's most likely states. `seeded`: the first scan is the map itself and has no NDT term.
    pub fn solve(
        &mut self,
        slots: &mut [Slot],
        prior: &Prior,
        submap: &Submap,
        seeded: bool,
        config: &Config,
    ) -> Option<Solution> {
        let odometry = &config.odometry;
        let mut solution = Solution::default();
        for &mu in &odometry.graduation {
            let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, mu);
            for slot in slots.iter_mut().skip(usize::from(seeded)) {
                let pose = submap.root.between(&slot.state.pose);
                Association::find(
                    &submap.grid,
                    &slot.cells,
                    &pose,
                    odometry.neighbours as usize,
                    &mut slot.associations,
                );
            }
            let iterations = if mu > 1.0 {
                ITERATIONS_WIDE
            } else {
                ITERATIONS_MAX
            };
            let mut cost = self.build(slots, prior, submap, seeded, &loss, config).0;
            for _ in 0..iterations {
                let covariance = self.chain.solve(&mut self.steps)?;
                solution.covariance = covariance;
                solution.iterations += 1;
                let largest = self
                    .steps
                    .iter()
                    .map(|step| step.fixed_rows::<3>(0).amax())
                    .fold(0.0, f64::max);
                if !largest.is_finite() {
                    return None;
                }
                cost = self.descend(slots, prior, submap, seeded, &loss, config, cost);
                if largest < STEP_MIN {
                    break;
                }
            }
            let (cost, newest) = self.build(slots, prior, submap, seeded, &loss, config);
            solution.cost = cost;
            if let Some(slot) = slots.last() {
                let used: usize = slot.associations.iter().map(|a| a.count).sum();
                solution.fit = newest.weight / used.max(1) as f64;
                solution.scan_information = newest.pose * ndt_weight(slot, config);
            }
        }
        Some(solution)
    }

    /// Takes the step that was solved for, halved as long as it raises the cost; gives the new cost and leaves the
    /// chain built there.
    #[allow(clippy::too_many_arguments)] // One loop's body, named; the arguments are the solve's own.
    fn descend(
        &mut self,
        slots: &mut [Slot],
        prior: &Prior,
        submap: &Submap,
        seeded: bool,
        loss: &AdaptiveLoss,
        config: &Config,
        cost: f64,
    ) -> f64 {
        self.before.clear();
        self.before.extend(slots.iter().map(|slot| slot.state));
        let mut scale = 1.0;
        for _ in 0..=HALVINGS_MAX {
            for ((slot, before), step) in slots.iter_mut().zip(&self.before).zip(&self.steps) {
                slot.state = before.plus(&(step * scale));
            }
            let new = self.build(slots, prior, submap, seeded, loss, config).0;
            if new <= cost {
                return new;
            }
            scale *= 0.5;
        }
        // No descent: the optimum is here as far as numbers can tell.
        for (slot, before) in slots.iter_mut().zip(&self.before) {
            slot.state = *before;
        }
        self.build(slots, prior, submap, seeded, loss, config).0
    }

    /// Builds the window's normal equations; gives the cost and the newest scan's NDT term.
    fn build(
        &mut self,
        slots: &[Slot],
        prior: &Prior,
        submap: &Submap,
        seeded: bool,
        loss: &AdaptiveLoss,
        config: &Config,
    ) -> (f64, NormalEquations) {
        let chain = &mut self.chain;
        chain.reset(slots.len());
        let mut cost = slots
            .first()
            .map_or(0.0, |first| prior.add(chain, &first.state));
        let mut newest = NormalEquations::default();
        for (i, slot) in slots.iter().enumerate() {
            if let Some(previous) = i.checked_sub(1).and_then(|before| slots.get(before)) {
                cost += factors::add(
                    chain,
                    i,
                    &previous.state,
                    &slot.state,
                    slot.dt_s,
                    slot.gyro.as_ref(),
                    &config.odometry,
                );
            }
            newest = NormalEquations::default();
            if i > 0 || !seeded {
                newest = ndt_term(slot, submap, loss);
                cost += add_ndt(chain, i, slot, &newest, config);
            }
        }
        (cost, newest)
    }

    /// What the oldest scan leaves behind when it goes: the prior of the second.
    pub fn marginalise(
        &mut self,
        oldest: &Slot,
        second: &Slot,
        prior: &Prior,
        submap: &Submap,
        seeded: bool,
        config: &Config,
    ) -> Option<Prior> {
        let odometry = &config.odometry;
        let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0);
        let chain = &mut self.pair;
        chain.reset(2);
        prior.add(chain, &oldest.state);
        if !seeded {
            let term = ndt_term(oldest, submap, &loss);
            add_ndt(chain, 0, oldest, &term, config);
        }
        factors::add(
            chain,
            1,
            &oldest.state,
            &second.state,
            second.dt_s,
            second.gyro.as_ref(),
            odometry,
        );
        let (information, gradient) = chain.marginal_of_second()?;
        let step = information.cholesky()?.solve(&-gradient);
        Some(Prior {
            mean: second.state.plus(&step),
            information,
        })
    }
}

/// Weight of one correspondence: the scan's weight, shared among cells and neighbours.
fn ndt_weight(slot: &Slot, config: &Config) -> f64 {
    config.odometry.ndt_weight
        / (slot.cells.len().max(1) as f64 * f64::from(config.odometry.neighbours))
}

fn ndt_term(slot: &Slot, submap: &Submap, loss: &AdaptiveLoss) -> NormalEquations {
    let pose = submap.root.between(&slot.state.pose);
    evaluate(
        &slot.cells,
        &slot.associations,
        &pose,
        slot.velocity_change(),
        loss,
    )
}

fn add_ndt(
    chain: &mut Chain,
    i: usize,
    slot: &Slot,
    term: &NormalEquations,
    config: &Config,
) -> f64 {
    let weight = ndt_weight(slot, config);
    let mut information = StateMatrix::zeros();
    let mut gradient = StateVector::zeros();
    information
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&term.pose);
    information
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&term.cross);
    information
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&term.cross.transpose());
    information
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&term.velocity);
    gradient
        .fixed_rows_mut::<3>(0)
        .copy_from(&term.pose_gradient);
    gradient
        .fixed_rows_mut::<3>(3)
        .copy_from(&term.velocity_gradient);
    if slot.gyro_covers_sweep {
        // The gyro removed the rotation: the yaw rate does not move the points.
        information.fill_row(5, 0.0);
        information.fill_column(5, 0.0);
        gradient[5] = 0.0;
    }
    chain.add_unary(i, &(information * weight), &(gradient * weight));
    term.cost * weight
}

/// Information of a scan's NDT term about its pose, at its present state and associations.
pub fn scan_information(
    slot: &Slot,
    submap: &Submap,
    loss: &AdaptiveLoss,
    config: &Config,
) -> Matrix3<f64> {
    ndt_term(slot, submap, loss).pose * ndt_weight(slot, config)
}

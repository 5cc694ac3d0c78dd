//! The NDT term of one scan in the window (paper, III-C): the map's word on pose and velocity.

use crate::{
    chain::Chain,
    slot::Slot,
    state::{StateMatrix, StateVector},
    submap::Submap,
};
use randt_config::Config;
use randt_ndt::{AdaptiveLoss, NormalEquations, evaluate};

/// The term at the scan's present state and associations, not yet weighted.
pub fn of(slot: &Slot, submap: &Submap, loss: &AdaptiveLoss) -> NormalEquations {
    let pose = submap.root.between(&slot.state.pose);
    evaluate(
        &slot.cells,
        &slot.associations,
        &pose,
        slot.velocity_change(),
        loss,
    )
}

/// Adds the scan's term to a chain; gives its cost.
pub fn add(chain: &mut Chain, i: usize, slot: &Slot, config: &Config) -> f64 {
    let (term, weight) = (&slot.ndt, slot.correspondence_information(config));
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

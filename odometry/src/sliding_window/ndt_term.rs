//! The NDT term of one scan in the window (RaNDT, III-C): how the scan fits the submap, by pose
//! and velocity.

use super::{
    block_tridiagonal::BlockTridiagonalSystem,
    state::{StateMatrix, StateVector},
    window_scan::WindowScan,
};
use crate::submaps::Submap;
use randt_config::Config;
use randt_ndt::{AdaptiveLoss, NormalEquations, evaluate};

/// The term at the scan's present state and associations, not yet weighted.
pub fn evaluate_scan(scan: &WindowScan, submap: &Submap, loss: &AdaptiveLoss) -> NormalEquations {
    let submap_from_base = submap.odom_from_root.between(&scan.state.odom_from_base);
    evaluate(
        &scan.cells,
        &scan.associations,
        &submap_from_base,
        scan.velocity_change(),
        loss,
    )
}

/// Adds the scan's term to a system; gives its cost.
pub fn add(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    scan: &WindowScan,
    config: &Config,
) -> f64 {
    let (term, weight) = (&scan.ndt, scan.correspondence_information(config));
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
    if scan.gyro_covers_sweep {
        // The gyro removed the rotation: the yaw rate does not move the points.
        information.fill_row(5, 0.0);
        information.fill_column(5, 0.0);
        gradient[5] = 0.0;
    }
    system.add_unary(i, &(information * weight), &(gradient * weight));
    term.cost * weight
}

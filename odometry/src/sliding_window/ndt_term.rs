//! The NDT term of one scan in the window (RaNDT, III-C): how the scan fits the submap, by pose
//! and velocity.

use super::{
    block_tridiagonal::BlockTridiagonalSystem,
    solver::Problem,
    state::{State, StateMatrix, StateVector},
    window_scan::WindowScan,
};
use crate::{
    localizability::{
        CELLS_MIN, Localizability, position_information, wall_information, weaker_direction,
    },
    submaps::Submap,
};
use randt_config::Config;
use randt_geometry::elementary::sin_cos;
use randt_messages::Localizability as Seen;
use randt_ndt::{AdaptiveLoss, Association, NormalEquations, evaluate};

/// Share of what the grid alone seems to give along a bare wall. A weak direction that has less
/// once the grid's part is taken out is not used at all: bare corridors have 0.0 to 0.3 left,
/// which is chance, the bends and bumps of a ring tunnel 1.1 and more.
const REMAINS_MIN: f64 = 1.0;
/// Scans in a row that must see every direction before one that was not seen is believed again:
/// cells that meet by chance do so once, and hold the pose where it is not.
pub const SEEING_MIN: u32 = 2;

/// Standard deviation of the heading that a cell of a scan gives which does not see every
/// direction, beside what its cells say, rad: 0.02 rad for the 25 cells of a scan in a bare
/// corridor. Five cells of a hall would else turn the gyro's bias by a degree a second.
const UNSEEN_HEADING_SIGMA_RAD: f64 = 0.1;

/// Share of its weight that a scan has whose way is by wheels: bent walls and far ends hold it
/// back where they were cut, and turn it. Live ATE of a rough ring tunnel and of a wide hall, two
/// seeds each: 2.0, 2.1, 0.60, 0.43 m at 1; 1.3, 1.8, 0.35, 0.29 m at 0.3; 1.3, 1.7, 0.31, 0.48 m
/// at 0.1; corridors the same.
const BY_TWIST_SHARE: f64 = 0.3;

/// Direction along the way, in the robot's frame, rad.
const FORWARD_RAD: f64 = 0.0;

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

/// Judges by the term as it is which directions the scan sees, and takes what it does not see out
/// of its associations and the term, where the accelerometer can carry the pose instead.
pub fn ignore_unseen(
    scan: &mut WindowScan,
    previous: Option<&State>,
    problem: &Problem,
    loss: &AdaptiveLoss,
) {
    let config = problem.config;
    let mut information = scan.scan_information(config);
    if scan.cells.len() < CELLS_MIN {
        scan.localizability = Localizability::NONE;
        scan.fixes_way = false;
        ignore_all(scan);
        return;
    }
    scan.localizability = Localizability::from_information(&information, scan.fit(), config);
    scan.judge_way(&information, config);
    if !scan.is_carried() {
        scan.scans_seeing_all = SEEING_MIN;
        return;
    }
    let mut sees_all = scan.localizability.seen == Seen::Full;
    if scan.localizability.seen == Seen::Partial {
        Association::ignore_filled_axes(&mut scan.associations, config.cell_rule());
        scan.ndt = evaluate_scan(scan, problem.submap, loss);
        information = scan.scan_information(config);
        let [remains, _] = position_information(&information);
        sees_all = remains >= REMAINS_MIN * wall_information(scan.fit(), config);
    }
    if let Some(previous) = previous {
        scan.judge_leap(previous);
    }
    sees_all &= !scan.leaps;
    if sees_all {
        scan.scans_seeing_all = SEEING_MIN.min(scan.scans_seeing_all_before + 1);
        if scan.scans_seeing_all >= SEEING_MIN {
            return;
        }
    } else {
        scan.scans_seeing_all = 0;
    }
    if scan.localizability.seen == Seen::None {
        ignore_all(scan);
        return;
    }
    let weak_direction_rad = if scan.leaps {
        FORWARD_RAD
    } else {
        weaker_direction(&information)
    };
    if scan.localizability.seen == Seen::Full {
        scan.localizability = Localizability {
            seen: Seen::Partial,
            weak_direction_rad,
        };
        scan.fixes_way = false;
    }
    let submap_from_base = problem
        .submap
        .odom_from_root
        .between(&scan.state.odom_from_base);
    let (sin, cos) = sin_cos(submap_from_base.yaw_rad + weak_direction_rad);
    Association::ignore_along(&mut scan.associations, [cos, sin]);
    scan.ndt = evaluate_scan(scan, problem.submap, loss);
}

/// The scan has no NDT term.
fn ignore_all(scan: &mut WindowScan) {
    scan.scans_seeing_all = 0;
    scan.associations.clear();
    scan.ndt = NormalEquations::default();
}

/// Adds the scan's term to a system; gives its cost.
pub fn add(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    scan: &WindowScan,
    config: &Config,
) -> f64 {
    let (term, mut weight) = (&scan.ndt, scan.correspondence_information(config));
    if scan.twist_way().is_some() {
        weight *= BY_TWIST_SHARE;
    }
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
    let (mut information, mut gradient) = (information * weight, gradient * weight);
    if scan.gyro.is_some() && scan.localizability.seen != Seen::Full {
        // Few cells, or walls alone, turn a pose as they please: their heading has a noise of its
        // own, and the gyro's counts.
        let by_heading = information.column(2).into_owned();
        let by_cell = UNSEEN_HEADING_SIGMA_RAD * UNSEEN_HEADING_SIGMA_RAD;
        let noise = by_cell / scan.cells.len().max(1) as f64;
        let share = 1.0 / (1.0 / noise + by_heading[2]);
        gradient -= by_heading * (gradient[2] * share);
        information -= by_heading * by_heading.transpose() * share;
    }
    system.add_unary(i, &information, &gradient);
    term.cost * weight
}

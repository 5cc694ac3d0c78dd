//! Cells of a wall's pillars and of vehicles, seen from a robot that drives along x.

use super::*;
use nalgebra::Vector3;
use randt_geometry::Pose2;
use randt_ndt::Cell;
use randt_persist::{Persist, Reader, Writer};

/// Way between two scans, m.
const STEP_M: f64 = 0.15;
/// Pillars of the wall, which stand.
const PILLARS: usize = 5;
/// Cells of two vehicles, which move along.
const VEHICLES: usize = 6;

/// A surface across the way.
fn cell(x_m: f64, y_m: f64) -> ScanCell {
    let cell = Cell {
        mean: [x_m, y_m, 20.0],
        covariance: [0.0025, 0.0, 0.3, 0.0, 0.0, 4.0],
        count: 20,
    };
    ScanCell::new(&cell, -0.1)
}

/// What a robot sees at this x that drives at this speed; the vehicles' cells come last.
fn scan(x_m: f64, speed_m_s: f64, with_vehicles: bool) -> WindowScan {
    let mut scan = WindowScan::default();
    scan.state.odom_from_base = Pose2::new(x_m, 0.0, 0.0);
    scan.deskew_velocity = Vector3::new(speed_m_s, 0.0, 0.0);
    let pillar = |number: usize| cell(1.7 * number as f64 - x_m, 4.0);
    scan.cells.extend((0..PILLARS).map(pillar));
    if with_vehicles {
        // De-skewed as if they stood.
        let shift_m = -0.1 * speed_m_s;
        let vehicle = |number: usize| {
            let ahead = if number.is_multiple_of(2) { 3.0 } else { -3.0 };
            cell(ahead + shift_m, (number / 2) as f64 - 1.0)
        };
        scan.cells.extend((0..VEHICLES).map(vehicle));
    }
    scan
}

/// What is left of a scan.
fn left(clutter: &mut MovingClutter, mut scan: WindowScan) -> usize {
    clutter.take_out(&mut scan);
    scan.cells.len()
}

#[test]
fn vehicles_that_drive_along_are_taken_out_and_what_stands_is_left() {
    let mut clutter = MovingClutter::new(&Config::default());
    let mut drive = |scans: core::ops::Range<usize>, with_vehicles: bool| {
        let seen = scans.map(|number| {
            let scan = scan(STEP_M * number as f64, 0.75, with_vehicles);
            (left(&mut clutter, scan), clutter.is_there())
        });
        seen.collect::<Vec<_>>()
    };
    // What stands alone is never taken out.
    assert_eq!(drive(0..20, false), [(PILLARS, false); 20]);
    let with_vehicles = drive(20..40, true);
    let found = with_vehicles.iter().position(|(_, is_there)| *is_there);
    assert!(found.is_some_and(|found| found <= 7), "{with_vehicles:?}");
    let after = &with_vehicles[found.unwrap()..];
    assert!(after.iter().all(|seen| *seen == (PILLARS, true)));
    assert_eq!(drive(40..60, false), [(PILLARS, false); 20]);
}

#[test]
fn vehicles_that_were_found_are_followed_through_a_stop() {
    let mut clutter = MovingClutter::new(&Config::default());
    for number in 0..10 {
        left(&mut clutter, scan(STEP_M * f64::from(number), 0.75, true));
    }
    assert!(clutter.is_there());
    let stop_m = STEP_M * 10.0;
    for _ in 0..20 {
        assert_eq!(left(&mut clutter, scan(stop_m, 0.0, true)), PILLARS);
    }
    for number in 1..10 {
        let scan = scan(stop_m + STEP_M * f64::from(number), 0.75, true);
        assert_eq!(left(&mut clutter, scan), PILLARS);
    }
}

#[test]
fn at_a_standstill_nothing_is_found() {
    let mut clutter = MovingClutter::new(&Config::default());
    for _ in 0..20 {
        assert_eq!(left(&mut clutter, scan(0.0, 0.0, true)), PILLARS + VEHICLES);
    }
    assert!(!clutter.is_there());
}

#[test]
fn what_was_found_survives_its_process() {
    let config = Config::default();
    let (mut whole, mut killed) = (MovingClutter::new(&config), MovingClutter::new(&config));
    let mut bytes = vec![0; 1 << 16];
    for number in 0..20 {
        let scan = scan(STEP_M * f64::from(number), 0.75, true);
        assert_eq!(left(&mut whole, scan.clone()), left(&mut killed, scan));
        killed.save(&mut Writer::new(&mut bytes));
        killed = MovingClutter::new(&config);
        killed.restore(&mut Reader::new(&bytes)).unwrap();
    }
    assert!(killed.is_there());
}

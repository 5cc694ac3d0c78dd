//! Cells of a scan, kept to be compared with those of a later one.

use crate::sliding_window::{CELLS, WindowScan};
use nalgebra::Vector3;
use randt_geometry::Pose2;
use randt_ndt::{Cell, ScanCell, scalar};
use randt_persist::persist;

/// Cells of a scan before, in its frame.
#[derive(Clone, Debug)]
pub struct EarlierCells {
    /// Where the scan ended, as it was predicted.
    odom_from_base: Pose2,
    /// Velocity that it was de-skewed by.
    velocity: Vector3<f64>,
    /// In order of x.
    cells: Vec<Cell>,
}

persist!(EarlierCells {
    odom_from_base,
    velocity,
    cells,
});

impl EarlierCells {
    /// None yet. What is never written costs no memory.
    pub fn with_room() -> Self {
        Self {
            odom_from_base: Pose2::IDENTITY,
            velocity: Vector3::zeros(),
            cells: Vec::with_capacity(CELLS),
        }
    }

    /// Becomes some cells of a scan.
    pub fn set(&mut self, scan: &WindowScan, is_one: impl Fn(usize) -> bool) {
        (self.odom_from_base, self.velocity) = (scan.state.odom_from_base, scan.deskew_velocity);
        self.cells.clear();
        let cells = scan.cells.iter().enumerate();
        let cells = cells.filter(|(index, _)| is_one(*index));
        self.cells
            .extend(cells.map(|(_, cell)| cell.cell).take(CELLS));
        self.cells
            .sort_unstable_by(|a, b| a.mean[0].total_cmp(&b.mean[0]));
    }

    /// Forgets them.
    pub fn clear(&mut self) {
        self.cells.clear();
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Where a cell of a later scan was if it stands.
    pub fn standing(&self, cell: &ScanCell, scan: &WindowScan) -> Cell {
        let way = self.odom_from_base.between(&scan.state.odom_from_base);
        scalar::moved(&cell.cell, &way)
    }

    /// Way from here to a scan, m.
    pub fn way_m(&self, scan: &WindowScan) -> f64 {
        let way = self.odom_from_base.between(&scan.state.odom_from_base);
        way.translation().norm()
    }

    /// Where a cell of a later scan was if it keeps its place at the robot: de-skewed as it was
    /// then.
    pub fn carried(&self, cell: &ScanCell, scan: &WindowScan) -> Cell {
        let change = self.velocity - scan.deskew_velocity;
        let (age_s, mut carried) = (cell.velocity_jacobian_s, cell.cell);
        let [x_m, y_m, _] = carried.mean;
        carried.mean[0] += age_s * (change.x - change.z * y_m);
        carried.mean[1] += age_s * (change.y + change.z * x_m);
        carried
    }

    /// Squared distance of the nearest one, as far as there is one within a reach.
    pub fn nearest(&self, cell: &Cell, reach_m: f64) -> f64 {
        let [x_m, y_m, _] = cell.mean;
        let first = self
            .cells
            .partition_point(|other| other.mean[0] < x_m - reach_m);
        let ahead = self.cells.iter().skip(first);
        ahead
            .take_while(|other| other.mean[0] <= x_m + reach_m)
            .filter(|other| (other.mean[1] - y_m).abs() <= reach_m)
            .map(|other| scalar::squared_distance(cell, other))
            .fold(f64::INFINITY, f64::min)
    }
}

//! One scan of the window: what was measured and what is estimated of it.

use crate::{
    deskew::{BeamPose, Motion, Point, beam_poses, deskew},
    heading::{GyroTerm, Heading},
    scan,
    state::State,
    tilt::Tilt,
};
use nalgebra::{Matrix3, Vector3};
use randt_config::{Config, Robot};
use randt_messages::{MAX_BEAMS, MAX_RETURNS, Message, RadarPoints};
use randt_ndt::{Association, Cell, CellRule, Grid, NormalEquations, ScanCell};
use randt_persist::{Error, Persist, Reader, Writer};

/// Cells of a scan that there is room for from the start: a Navtech's sweep of 30,000 returns has fewer than 2,000.
const CELLS: usize = 8192;

/// A scan with its state. Reused, so that a step allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Slot {
    /// The filtered returns as they came.
    pub scan: Message<RadarPoints>,
    /// The estimate.
    pub state: State,
    /// Time since the scan before, s; 0 for the first of a frame.
    pub dt_s: f64,
    /// What the gyro says since the scan before.
    pub gyro: Option<GyroTerm>,
    /// Whether the gyro covers the sweep.
    pub gyro_covers_sweep: bool,
    /// Roll and pitch.
    pub tilt: Tilt,
    /// Poses of the beams.
    pub beams: Vec<BeamPose>,
    /// De-skewed returns.
    pub points: Vec<Point>,
    /// Velocity that they were de-skewed by.
    pub deskew_velocity: Vector3<f64>,
    /// NDT cells of the points.
    pub cells: Vec<ScanCell>,
    /// Their counterparts in the submap.
    pub associations: Vec<Association>,
    /// What they say, as of the last solve.
    pub ndt: NormalEquations,
}

impl Slot {
    /// An empty one with room for every scan that there can be. What is never written costs no memory.
    pub fn with_room() -> Self {
        let mut slot = Self::default();
        slot.scan.items.reserve(MAX_RETURNS);
        slot.beams.reserve(MAX_BEAMS);
        slot.points.reserve(MAX_RETURNS);
        slot.cells.reserve(CELLS);
        slot.associations.reserve(CELLS);
        slot
    }

    /// De-skews by the present state and the one before.
    pub fn deskew(
        &mut self,
        robot: &Robot,
        previous: Option<&State>,
        heading: Option<&Heading>,
        remove_motion: bool,
    ) {
        let motion = Motion {
            velocity: self.state.velocity,
            previous: previous.map(|state| (state.velocity, self.dt_s)),
            gyro: heading
                .filter(|_| self.gyro_covers_sweep)
                .map(|heading| (heading, self.state.bias_rad_s)),
            tilt: self.tilt,
        };
        beam_poses(
            &self.scan,
            robot,
            remove_motion.then_some(&motion),
            &mut self.beams,
        );
        deskew(&self.scan, &self.beams, &mut self.points);
        self.deskew_velocity = self.state.velocity;
    }

    /// Information of one correspondence: the scan's, shared among cells and neighbours.
    pub fn correspondence_information(&self, config: &Config) -> f64 {
        let shares = self.cells.len().max(1) as f64 * f64::from(config.odometry.neighbours);
        config.odometry.ndt_weight / shares
    }

    /// Information that the scan itself gives about its pose, in the robot's frame.
    pub fn scan_information(&self, config: &Config) -> Matrix3<f64> {
        self.ndt.pose * self.correspondence_information(config)
    }

    /// How far the velocity has moved from the one that the points were de-skewed by.
    pub fn velocity_change(&self) -> [f64; 3] {
        let mut change = self.state.velocity - self.deskew_velocity;
        if self.gyro_covers_sweep {
            // The gyro removed the rotation, whatever the velocity says of it.
            change.z = 0.0;
        }
        change.into()
    }
}

/// Poses of beams, points and associations are made anew before they are looked at again.
impl Persist for Slot {
    fn save(&self, out: &mut Writer<'_>) {
        scan::save(&self.scan, out);
        self.state.save(out);
        self.dt_s.save(out);
        self.gyro.save(out);
        self.gyro_covers_sweep.save(out);
        self.tilt.save(out);
        self.deskew_velocity.save(out);
        self.cells.save(out);
        self.ndt.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        scan::restore(&mut self.scan, from)?;
        self.state.restore(from)?;
        self.dt_s.restore(from)?;
        self.gyro.restore(from)?;
        self.gyro_covers_sweep.restore(from)?;
        self.tilt.restore(from)?;
        self.deskew_velocity.restore(from)?;
        self.cells.restore(from)?;
        self.ndt.restore(from)
    }
}

/// Makes cells of a scan's points, with their levers.
#[derive(Clone, Debug)]
pub struct CellMaker {
    grid: Grid,
    levers: Vec<f64>,
    azimuth_sigma_rad: f64,
}

impl CellMaker {
    /// A grid around the robot.
    pub fn new(config: &Config) -> Self {
        let grid = Grid::new(config.scan_extent_m(), cell_rule(config));
        Self {
            grid,
            levers: Vec::with_capacity(CELLS),
            azimuth_sigma_rad: config.sensor.azimuth_sigma_rad,
        }
    }

    /// The cells of `points`, in order of their first point.
    pub fn make(&mut self, points: &[Point], cells: &mut Vec<ScanCell>) {
        self.grid.clear();
        self.levers.clear();
        for point in points {
            let Some(slot) = self.grid.add([point.x_m, point.y_m, point.intensity]) else {
                continue;
            };
            if slot == self.levers.len() {
                self.levers.push(0.0);
            }
            if let Some(lever) = self.levers.get_mut(slot) {
                *lever += point.lever_s;
            }
        }
        self.grid.refresh();
        cells.clear();
        cells.extend(self.levers.iter().enumerate().filter_map(|(slot, lever)| {
            let cell: &Cell = self.grid.cell(slot)?;
            let lever = lever / f64::from(cell.count);
            Some(ScanCell::new(&blurred(cell, self.azimuth_sigma_rad), lever))
        }));
    }
}

/// Which points make a cell, in scans and submaps alike.
pub fn cell_rule(config: &Config) -> CellRule {
    CellRule {
        points_min: config.ndt.points_min,
        use_intensity: config.ndt.intensity,
        cell_size_m: config.cell_size_m(),
        slack: config.ndt.slack,
    }
}

/// Widens a cell across the line of sight: a radar is exact in range and poor in azimuth, the more the farther.
fn blurred(cell: &Cell, azimuth_sigma_rad: f64) -> Cell {
    let mut cell = *cell;
    // (-y, x) sigma is the tangent of the cell's distance, scaled.
    let (tx, ty) = (
        -azimuth_sigma_rad * cell.mean[1],
        azimuth_sigma_rad * cell.mean[0],
    );
    cell.covariance[0] += tx * tx;
    cell.covariance[1] += tx * ty;
    cell.covariance[2] += ty * ty;
    cell
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_blurred_across_the_line_of_sight_alone() {
        let cell = Cell {
            mean: [6.0, 8.0, 9.0],
            covariance: [0.02, 0.0, 0.02, 0.0, 0.0, 1.0],
            count: 9,
        };
        let [xx, xy, yy, ..] = blurred(&cell, 0.01).covariance;
        let along = |x: f64, y: f64| x * x * xx + 2.0 * x * y * xy + y * y * yy;
        assert!((along(0.6, 0.8) - 0.02).abs() < 1e-12);
        assert!((along(-0.8, 0.6) - (0.02 + 0.1 * 0.1)).abs() < 1e-12);
    }
}

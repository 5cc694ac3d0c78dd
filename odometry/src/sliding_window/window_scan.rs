//! One scan of the window: what was measured, and what is estimated from it.

use super::{
    state::{State, StateMatrix},
    twist_term::TwistWay,
};
use crate::{
    deskew::{BeamPose, Motion, Point, beam_poses, deskew},
    gyro_check::BiasChange,
    gyro_integrator::{GyroIntegrator, GyroTerm},
    inertial_speed::{RadarFix, Speed},
    localizability::{Localizability, wall_information},
    scan::Scan,
    tilt::Tilt,
    tracking_status::TrackingStatus,
};
use nalgebra::{Matrix2, Matrix3, Vector3};
use randt_config::Config;
use randt_geometry::marginalize_yaw;
use randt_messages::{Localizability as Seen, MAX_BEAMS, MAX_RETURNS, Trust};
use randt_ndt::{Association, NormalEquations, ScanCell};
use randt_persist::persist;

/// Cells of a scan that there is room for from the start: a Navtech's sweep of 30,000 returns has
/// fewer than 2,000.
pub const CELLS: usize = 8192;

/// Share of the grid's own information in that along the forward axis above which it counts: by
/// that share a fix repeats where the robot was predicted.
const GRID_SHARE_MAX: f64 = 1.0 / 6.0;
/// Standard deviation of the way between two scans that cells fix, m (sound drives: 0.02 to 0.03).
const WAY_SIGMA_M: f64 = 0.03;
/// A way that differs from the IMU's by more standard deviations is a leap.
const LEAP_SIGMAS: f64 = 4.0;

/// A scan with its state. Its fields are what the steps that it goes through leave for each other.
/// Reused, so that a step allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct WindowScan {
    /// The filtered returns as they came.
    pub message: Scan,
    /// The estimate.
    pub state: State,
    /// Time since the scan before, s; 0 for the first of a frame.
    pub dt_s: f64,
    /// What the gyro measured since the scan before.
    pub gyro: Option<GyroTerm>,
    /// How the gyro's bias has changed since then, beside its walk.
    pub bias_change: BiasChange,
    /// The way since then by wheels that are believed.
    pub twist: Option<TwistWay>,
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
    /// Their counterparts in the submap as of the last round, one entry a cell.
    pub associations: Vec<Association>,
    /// Their normal equations, as of the last solve.
    pub ndt: NormalEquations,
    /// Which directions its cells see, as of the last solve.
    pub localizability: Localizability,
    /// Whether its cells fix the way forward, and those of the scan before did when this one came.
    pub fixes_way: bool,
    pub follows_fix: bool,
    /// How many scans up to it see every direction, in a row and up to those that must: with it,
    /// and before it.
    pub scans_seeing_all: u32,
    pub scans_seeing_all_before: u32,
    /// Whether its cells, as far as they were followed, made it leap away from where the IMU has
    /// it.
    pub leaps: bool,
    /// Largest variance of its position when it was the newest one, m^2, and how much of it came
    /// with it.
    pub position_variance_m2: f64,
    pub drift_m2: f64,
    /// How it was judged when it was the newest one.
    pub status: TrackingStatus,
}

// Poses of beams, points and associations are made anew before they are read again.
persist!(WindowScan {
    message,
    state,
    dt_s,
    gyro,
    bias_change,
    twist,
    gyro_covers_sweep,
    tilt,
    deskew_velocity,
    cells,
    ndt,
    localizability,
    fixes_way,
    follows_fix,
    scans_seeing_all,
    scans_seeing_all_before,
    leaps,
    position_variance_m2,
    drift_m2,
    status,
} kept {
    beams,
    points,
    associations,
});

impl WindowScan {
    /// Whether its pose is fixed every way, and believed.
    pub fn is_sure(&self) -> bool {
        self.localizability.seen == Seen::Full && self.status.trust() == Trust::Good
    }

    /// An empty one with room for the largest scan. What is never written costs no memory.
    pub fn with_room() -> Self {
        let mut scan = Self {
            message: Scan::with_room(),
            ..Self::default()
        };
        scan.beams.reserve(MAX_BEAMS);
        scan.points.reserve(MAX_RETURNS);
        scan.cells.reserve(CELLS);
        scan.associations.reserve(CELLS);
        scan
    }

    /// De-skews by the present state and the one before.
    pub fn deskew(
        &mut self,
        previous: Option<&State>,
        gyro: Option<&GyroIntegrator>,
        config: &Config,
    ) {
        let previous = previous.filter(|_| self.dt_s > 0.0);
        let motion = Motion {
            velocity: self.state.velocity,
            previous: previous.map(|state| (state.velocity, self.dt_s)),
            gyro: gyro
                .filter(|_| self.gyro_covers_sweep)
                .map(|gyro| (gyro, self.state.bias_rad_s)),
            tilt: self.tilt,
        };
        beam_poses(
            &self.message,
            &config.robot,
            config.odometry.deskew.then_some(&motion),
            &mut self.beams,
        );
        deskew(&self.message, &self.beams, &mut self.points);
        self.deskew_velocity = self.state.velocity;
    }

    /// Forgets what the gyro measured.
    pub fn drop_gyro(&mut self) {
        (self.gyro, self.gyro_covers_sweep) = (None, false);
        self.tilt = Tilt::LEVEL;
    }

    /// Variance that its step adds where its cells do not hold the position, in its own frame,
    /// m^2: what the uncertain speed makes of it, which is the same from step to step.
    pub fn drift_covariance(&self) -> Matrix2<f64> {
        self.localizability.unseen() * self.drift_m2
    }

    /// The way by wheels, where the cells do not fix it.
    pub fn twist_way(&self) -> Option<TwistWay> {
        self.twist.filter(|_| !self.fixes_way)
    }

    /// The measured change of speed since the scan before, where neither the cells nor wheels fix
    /// the way.
    pub fn speed_change(&self) -> Option<Speed> {
        let gyro = (self.gyro).filter(|_| !self.fixes_way && self.twist.is_none())?;
        gyro.speed_change
    }

    /// The forward speed as radar and IMU knew it together when the cells stopped to fix the way.
    pub fn last_seen_speed(&self) -> Option<Speed> {
        let is_free = !self.fixes_way && self.twist.is_none();
        let gyro = self.gyro.filter(|_| is_free && self.follows_fix)?;
        gyro.speed
    }

    /// Whether the accelerometer or wheels carry the speed on without the radar.
    pub fn is_carried(&self) -> bool {
        let carries = |gyro: GyroTerm| gyro.speed_change.is_some() || gyro.stands;
        self.twist.is_some() || self.gyro.is_some_and(carries)
    }

    /// Whether the IMU shows that the robot stands, where the cells do not fix the way.
    pub fn stands(&self) -> bool {
        !self.fixes_way && self.gyro.is_some_and(|gyro| gyro.stands)
    }

    /// Judges whether the cells fix the way forward: the grid's own information, which repeats
    /// what was predicted, must not count beside theirs.
    pub fn judge_way(&mut self, information: &Matrix3<f64>, config: &Config) {
        let wall = wall_information(self.fit(), config);
        let inverse = marginalize_yaw(information).try_inverse();
        let share = inverse.map_or(1.0, |covariance| wall * covariance.m11);
        self.fixes_way = self.localizability.seen == Seen::Full && share < GRID_SHARE_MAX;
    }

    /// Whether its cells lead it, along the way, to where the IMU says that it cannot be.
    pub fn judge_leap(&mut self, previous: &State) {
        let measured = self.gyro.and_then(|gyro| gyro.speed.zip(gyro.speed_change));
        let Some((speed, change)) = measured else {
            return;
        };
        let ([speed_m_s, _], [change_m_s, _]) = (speed.value_m_s, change.value_m_s);
        let [speed_sigma_m_s, _] = speed.sigma_m_s;
        let moved = previous.odom_from_base.between(&self.state.odom_from_base);
        let leap_m = moved.x_m - (speed_m_s - 0.5 * change_m_s) * self.dt_s;
        let carried_sigma_m = speed_sigma_m_s * self.dt_s;
        let variance_m2 = WAY_SIGMA_M * WAY_SIGMA_M + carried_sigma_m * carried_sigma_m;
        self.leaps |= leap_m * leap_m > LEAP_SIGMAS * LEAP_SIGMAS * variance_m2;
    }

    /// Where the cells have the robot, with that covariance, where they fix its way.
    pub fn radar_fix(&self, covariance: &StateMatrix) -> Option<RadarFix> {
        self.fixes_way.then(|| RadarFix {
            pose: self.state.odom_from_base,
            sigma_m: [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()],
        })
    }

    /// Mean robust weight of its correspondences, 0..1.
    pub fn fit(&self) -> f64 {
        let used: usize = self.associations.iter().map(|a| a.count).sum();
        self.ndt.weight / used.max(1) as f64
    }

    /// Information of one correspondence: that of the scan, shared among cells and neighbours.
    pub fn correspondence_information(&self, config: &Config) -> f64 {
        let shares = self.cells.len().max(1) as f64 * f64::from(config.odometry.neighbours);
        config.odometry.ndt_weight / shares
    }

    /// Information that the scan by itself gives about its pose, in the robot's frame.
    pub fn scan_information(&self, config: &Config) -> Matrix3<f64> {
        self.ndt.pose * self.correspondence_information(config)
    }

    /// How far the velocity has moved from the one that the points were de-skewed by.
    pub fn velocity_change(&self) -> [f64; 3] {
        let mut change = self.state.velocity - self.deskew_velocity;
        if self.gyro_covers_sweep {
            // The gyro removed the rotation: the estimated yaw rate does not matter.
            change.z = 0.0;
        }
        change.into()
    }
}

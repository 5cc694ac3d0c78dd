//! What the filter follows: speed, vertical and biases, with their covariance.

use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use randt_config::Odometry;
use randt_filter::StandstillBias;
use randt_persist::persist;

/// Speed along the robot's axes (x, y), the vertical's x and y, bias of the rates (x, y) and of
/// the accelerations (x, y), and the way since the last scan, all in `base_link`.
pub const STATES: usize = 10;
pub const SPEED: usize = 0;
pub const VERTICAL: usize = 2;
pub const RATE_BIAS: usize = 4;
pub const ACCELERATION_BIAS: usize = 6;
pub const WAY: usize = 8;

type Covariance = SMatrix<f64, STATES, STATES>;

/// Standard gravity, m/s^2, and how far what is measured may be off it: bias and scale of a poor
/// accelerometer. One without gravity, or in other units, is further off.
pub const GRAVITY_M_S2: f64 = 9.806_65;
const LENGTH_TOLERANCE_M_S2: f64 = 1.0;
/// Cosine of the tilt from which a robot does not stand on its wheels, or its IMU is mounted
/// otherwise than it is said.
const UPRIGHT_MIN: f64 = 0.5;
/// How well one sample shows the vertical while the robot may drive, as a slope.
const FIRST_VERTICAL_SIGMA: f64 = 0.1;
/// Speed of a robot of which nothing is known, m/s.
const FIRST_SPEED_SIGMA_M_S: f64 = 3.0;
/// Bias of a MEMS accelerometer (data sheets: 2 to 5 mg), m/s^2.
const ACCELERATION_BIAS_SIGMA_M_S2: f64 = 0.04;
/// Noise of an accelerometer, with what vibration, a nodding mast and its scale leave, m/s^2 per
/// square root of Hz.
pub const ACCELERATION_NOISE: f64 = 0.015;
/// The covariance moves on in steps of this, ns: a gyro's bias does not notice.
const STEP_NS: i64 = 20_000_000;
/// How far off the radar has the scan at which a way begins, m.
const FIRST_WAY_SIGMA_M: f64 = 0.02;

/// The states, all in the robot's frame. Its fields are one vector of ten, by what they are.
#[derive(Clone, Debug)]
pub struct InertialState {
    /// Densities of the gyro's noise and of its bias's walk, and the bias at the start.
    gyro_noise: f64,
    gyro_bias_walk: f64,
    gyro_bias_sigma_rad_s: f64,
    /// Speed along the robot's axes.
    pub speed_m_s: Vector2<f64>,
    /// The vertical: a unit vector.
    pub up: Vector3<f64>,
    /// Of the rates about x and y.
    pub rate_bias_rad_s: Vector2<f64>,
    /// Of the accelerations.
    pub acceleration_bias_m_s2: Vector2<f64>,
    /// From where the radar had the last scan.
    pub way_m: Vector2<f64>,
    /// Of all of them, in this order.
    pub covariance: Covariance,
    /// The last change of speed.
    change_m_s2: Vector2<f64>,
    /// Time and turn by which the covariance lags behind, ns and rad.
    lag_ns: i64,
    lag_rad: f64,
}

persist!(InertialState {
    speed_m_s,
    up,
    rate_bias_rad_s,
    acceleration_bias_m_s2,
    way_m,
    covariance,
    change_m_s2,
    lag_ns,
    lag_rad,
} kept {
    gyro_noise,
    gyro_bias_walk,
    gyro_bias_sigma_rad_s,
});

impl InertialState {
    /// Nothing known.
    pub fn new(odometry: &Odometry) -> Self {
        Self {
            gyro_noise: odometry.gyro_noise_rad_s_sqrt_hz,
            gyro_bias_walk: odometry.gyro_bias_walk,
            gyro_bias_sigma_rad_s: odometry.gyro_bias_sigma_rad_s,
            speed_m_s: Vector2::zeros(),
            up: Vector3::z(),
            rate_bias_rad_s: Vector2::zeros(),
            acceleration_bias_m_s2: Vector2::zeros(),
            way_m: Vector2::zeros(),
            covariance: Covariance::zeros(),
            change_m_s2: Vector2::zeros(),
            lag_ns: 0,
            lag_rad: 0.0,
        }
    }

    /// Starts: one sample shows the vertical, more or less.
    pub fn start(&mut self, force_m_s2: Vector3<f64>) {
        self.up = force_m_s2.normalize();
        self.speed_m_s = Vector2::zeros();
        self.rate_bias_rad_s = Vector2::zeros();
        self.acceleration_bias_m_s2 = Vector2::zeros();
        self.way_m = Vector2::zeros();
        self.change_m_s2 = Vector2::zeros();
        (self.lag_ns, self.lag_rad) = (0, 0.0);
        let sigmas = [
            FIRST_SPEED_SIGMA_M_S,
            FIRST_VERTICAL_SIGMA,
            self.gyro_bias_sigma_rad_s,
            ACCELERATION_BIAS_SIGMA_M_S2,
            FIRST_WAY_SIGMA_M,
        ];
        let variances = SVector::from_fn(|i, _| sigmas.get(i / 2).map_or(0.0, |s| s * s));
        self.covariance = Covariance::from_diagonal(&variances);
    }

    /// Integrates a sample over the time since the one before; gives the change of the level
    /// speed, m/s.
    pub fn integrate(
        &mut self,
        dt_ns: i64,
        mut rate_rad_s: Vector3<f64>,
        force_m_s2: Vector3<f64>,
    ) -> Vector2<f64> {
        let dt_s = dt_ns as f64 * 1e-9;
        let mut level = rate_rad_s.fixed_rows_mut::<2>(0);
        level -= self.rate_bias_rad_s;
        // The vertical turns against the robot.
        let turned = self.up - rate_rad_s.cross(&self.up) * dt_s;
        self.up = unit(turned);
        let against_turn = |v: Vector2<f64>| Vector2::new(v.y, -v.x) * rate_rad_s.z;
        let change_m_s2 =
            force_m_s2.xy() - self.acceleration_bias_m_s2 - self.up.xy() * GRAVITY_M_S2
                + against_turn(self.speed_m_s);
        let before_m_s = self.level_speed_m_s();
        self.way_m += (before_m_s + against_turn(self.way_m)) * dt_s;
        self.speed_m_s += (self.change_m_s2 + change_m_s2) * (0.5 * dt_s);
        self.change_m_s2 = change_m_s2;
        self.lag_ns = self.lag_ns.saturating_add(dt_ns);
        self.lag_rad += rate_rad_s.z * dt_s;
        if self.lag_ns >= STEP_NS {
            self.propagate();
        }
        self.level_speed_m_s() - before_m_s
    }

    /// The speed of the robot's shadow in the level plane, which the radar's poses are in.
    pub fn level_speed_m_s(&self) -> Vector2<f64> {
        let cosines = self.up.xy().map(|slope| (1.0 - slope * slope).sqrt());
        self.speed_m_s.component_mul(&cosines)
    }

    /// Moves the covariance on by the time that it lags behind.
    pub fn propagate(&mut self) {
        let (dt_s, turn_rad) = (self.lag_ns as f64 * 1e-9, self.lag_rad);
        (self.lag_ns, self.lag_rad) = (0, 0.0);
        let mut f = Covariance::identity();
        for first in [SPEED, VERTICAL, WAY] {
            // A vector of the world turns against the robot.
            f[(first, first + 1)] = turn_rad;
            f[(first + 1, first)] = -turn_rad;
        }
        for axis in 0..2 {
            f[(SPEED + axis, VERTICAL + axis)] = -GRAVITY_M_S2 * dt_s;
            f[(SPEED + axis, ACCELERATION_BIAS + axis)] = -dt_s;
            f[(WAY + axis, SPEED + axis)] = dt_s;
        }
        // d up / dt = up x rate: a rate about y moves its x, one about x its y.
        f[(VERTICAL, RATE_BIAS + 1)] = dt_s;
        f[(VERTICAL + 1, RATE_BIAS)] = -dt_s;
        let moved = f * self.covariance * f.transpose();
        // Rounding makes it skew, and the skew part grows: after 40 minutes it is no covariance.
        self.covariance = (moved + moved.transpose()) * 0.5;
        let densities = [ACCELERATION_NOISE, self.gyro_noise, self.gyro_bias_walk];
        for (i, density) in densities.into_iter().enumerate() {
            for axis in 0..2 {
                self.covariance[(2 * i + axis, 2 * i + axis)] += density * density * dt_s;
            }
        }
    }

    /// One scalar measurement of a sum of states, `by` their shares.
    pub fn update(&mut self, by: &SVector<f64, STATES>, innovation: f64, sigma: f64) {
        let shared = self.covariance * by;
        let variance = by.dot(&shared) + sigma * sigma;
        let gain = shared / variance;
        self.covariance -= gain * shared.transpose();
        let correction = gain * innovation;
        self.speed_m_s += correction.fixed_rows::<2>(SPEED);
        self.rate_bias_rad_s += correction.fixed_rows::<2>(RATE_BIAS);
        self.acceleration_bias_m_s2 += correction.fixed_rows::<2>(ACCELERATION_BIAS);
        self.way_m += correction.fixed_rows::<2>(WAY);
        let moved = Vector3::new(correction[VERTICAL], correction[VERTICAL + 1], 0.0);
        self.up = unit(self.up + moved);
    }

    /// Variance of a sum of states.
    pub fn variance(&self, by: &SVector<f64, STATES>) -> f64 {
        by.dot(&(self.covariance * by))
    }

    /// The vertical that a still window shows, by x and y: the states' shares in it, and how far it
    /// is off what they say.
    pub fn shown_slope(&self, still: &StandstillBias) -> ([SVector<f64, STATES>; 2], Vector2<f64>) {
        let shown = still.gravity_m_s2.normalize().xy();
        let off = shown - self.up.xy() - self.acceleration_bias_m_s2 / GRAVITY_M_S2;
        let by = [0, 1]
            .map(|axis| single(VERTICAL + axis) + single(ACCELERATION_BIAS + axis) / GRAVITY_M_S2);
        (by, off)
    }

    /// The way begins anew, at a scan that may be as far off as one is.
    pub fn begin_way(&mut self) {
        self.way_m = Vector2::zeros();
        for axis in [WAY, WAY + 1] {
            self.covariance.row_mut(axis).fill(0.0);
            self.covariance.column_mut(axis).fill(0.0);
            self.covariance[(axis, axis)] = FIRST_WAY_SIGMA_M * FIRST_WAY_SIGMA_M;
        }
    }
}

/// A state by itself.
pub fn single(state: usize) -> SVector<f64, STATES> {
    SVector::from_fn(|i, _| if i == state { 1.0 } else { 0.0 })
}

fn unit(vector: Vector3<f64>) -> Vector3<f64> {
    let unit = vector.try_normalize(f64::MIN_POSITIVE);
    unit.unwrap_or_else(Vector3::z)
}

/// Whether a force is that of gravity on a robot that is upright, m/s^2.
pub fn is_gravity(force_m_s2: Vector3<f64>) -> bool {
    let length_m_s2 = force_m_s2.norm();
    (length_m_s2 - GRAVITY_M_S2).abs() < LENGTH_TOLERANCE_M_S2
        && force_m_s2.z > UPRIGHT_MIN * length_m_s2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_covariance_stays_one_for_hours() {
        const SCAN_NS: i64 = 200_000_000;
        let mut state = InertialState::new(&Odometry::default());
        let gravity = Vector3::new(0.0, 0.0, GRAVITY_M_S2);
        state.start(gravity);
        for scan in 0..15_000 {
            // To and fro; the radar has each scan, as long as the robot drives.
            let rate_rad_s = if scan % 100 < 50 { 0.5 } else { -0.3 };
            for _ in 0..10 {
                state.integrate(SCAN_NS / 10, Vector3::z() * rate_rad_s, gravity);
            }
            state.propagate();
            for axis in 0..2 {
                state.update(&single(WAY + axis), -state.way_m[axis], 0.02);
            }
            state.way_m = Vector2::zeros();
            let covariance = &state.covariance;
            let least = covariance.diagonal().min();
            let skew = (covariance - covariance.transpose()).amax();
            assert!(least > 0.0 && skew < 1e-12, "scan {scan}: {least}, {skew}");
        }
    }
}

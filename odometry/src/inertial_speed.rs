//! The speed that an IMU carries on where the radar shows none: a Kalman filter of speed, vertical
//! and biases, which the radar's speed corrects as long as there is one.

use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use randt_config::Odometry;
use randt_filter::StandstillBias;
use randt_geometry::Pose2;
use randt_persist::persist;

/// Speed along the robot's axes (x, y), the vertical's x and y, bias of the rates (x, y) and of the
/// accelerations (x, y), and the way since the last scan, all in `base_link`.
const STATES: usize = 10;
const SPEED: usize = 0;
const VERTICAL: usize = 2;
const RATE_BIAS: usize = 4;
const ACCELERATION_BIAS: usize = 6;
const WAY: usize = 8;

type Covariance = SMatrix<f64, STATES, STATES>;

/// Standard gravity, m/s^2, and how far what is measured may be off it: bias and scale of a poor
/// accelerometer. One without gravity, or in other units, is further off.
const GRAVITY_M_S2: f64 = 9.806_65;
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
/// Its noise, with what vibration, a mast that nods and the scale leave of it, m/s^2 per square root
/// of Hz.
const ACCELERATION_NOISE: f64 = 0.015;
/// The covariance moves on in steps of this, ns: a gyro's bias does not notice.
const STEP_NS: i64 = 20_000_000;
/// How well a still window shows the vertical, as a slope, and that the robot stands, m/s: it may be
/// the end of a slow stop.
const STILL_VERTICAL_SIGMA: f64 = 0.006;
const STILL_SPEED_SIGMA_M_S: f64 = 0.03;
/// What differs by more standard deviations is no standstill but an even acceleration.
const GATE_SIGMAS: f64 = 3.0;
/// Speed that a robot has not gained while it stands, m/s.
const DEPARTED_M_S: f64 = 0.05;
/// Longest time between two scans whose way is compared, ns.
const STEP_MAX_NS: i64 = 2_000_000_000;
/// How far off the radar has the scan at which a way begins, m.
const FIRST_WAY_SIGMA_M: f64 = 0.02;
/// Memory of the comparison with the radar, s: some changes of speed.
const MEMORY_S: f64 = 10.0;
/// The IMU does not carry the speed before it was compared for this long, s.
const COMPARED_MIN_S: f64 = 5.0;
/// ... nor where the mean square of what it differs by is this many times what it expects.
const NIS_MAX: f64 = 9.0;
/// ... nor where its speed is known no better than this, m/s: a robot's own is as good.
const CARRIED_SIGMA_MAX_M_S: f64 = 0.5;
/// A speed that errs the same way for the whole span moves the position by more than one that is
/// drawn anew at each scan, as the window has it: sqrt(3 / 2) for an error that grows evenly.
const CORRELATED: f64 = 1.23;

/// A speed forward and to the left, or a change of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speed {
    /// Speed or change, m/s.
    pub value_m_s: [f64; 2],
    /// Standard deviations, m/s.
    pub sigma_m_s: [f64; 2],
}

persist!(Speed {
    value_m_s,
    sigma_m_s
});

/// Where the radar has a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarFix {
    /// Pose in `odom`.
    pub pose: Pose2,
    /// Standard deviations forward and to the left, m.
    pub sigma_m: [f64; 2],
}

/// What the filter had at the last scan.
#[derive(Clone, Copy, Debug, Default)]
struct AtScan {
    stamp_ns: i64,
    integral_m_s: Vector2<f64>,
    variances: [f64; 2],
    /// Where the radar had it.
    odom_from_base: Option<Pose2>,
}

persist!(AtScan {
    stamp_ns,
    integral_m_s,
    variances,
    odom_from_base
});

/// Carries the forward speed by accelerometer and gyro.
#[derive(Clone, Debug)]
pub struct InertialSpeed {
    /// Densities of the gyro's noise and of its bias's walk, and the bias at the start.
    gyro_noise: f64,
    gyro_bias_walk: f64,
    gyro_bias_sigma_rad_s: f64,
    /// The last sample's stamp and change of speed, ns and m/s^2; `None` before the first one that
    /// shows gravity.
    last: Option<(i64, Vector2<f64>)>,
    speed_m_s: Vector2<f64>,
    /// Unit vector in the robot's frame.
    up: Vector3<f64>,
    rate_bias_rad_s: Vector2<f64>,
    acceleration_bias_m_s2: Vector2<f64>,
    /// From where the radar had the last scan.
    way_m: Vector2<f64>,
    covariance: Covariance,
    /// Time and turn by which the covariance lags behind, ns and rad.
    lag_ns: i64,
    lag_rad: f64,
    /// All changes of the speed, without corrections, m/s.
    integral_m_s: Vector2<f64>,
    /// Whether the last window was still, and the integral at the last one that was, m/s.
    is_still: bool,
    stood_m_s: Option<f64>,
    at_scan: Option<AtScan>,
    /// Mean square of the forward innovations in their standard deviations, and for how long they
    /// were compared, s.
    nis: f64,
    compared_s: f64,
}

persist!(InertialSpeed {
    last,
    speed_m_s,
    up,
    rate_bias_rad_s,
    acceleration_bias_m_s2,
    way_m,
    covariance,
    lag_ns,
    lag_rad,
    integral_m_s,
    is_still,
    stood_m_s,
    at_scan,
    nis,
    compared_s,
} kept {
    gyro_noise,
    gyro_bias_walk,
    gyro_bias_sigma_rad_s,
});

impl InertialSpeed {
    /// Nothing known yet.
    pub fn new(odometry: &Odometry) -> Self {
        Self {
            gyro_noise: odometry.gyro_noise_rad_s_sqrt_hz,
            gyro_bias_walk: odometry.gyro_bias_walk,
            gyro_bias_sigma_rad_s: odometry.gyro_bias_sigma_rad_s,
            last: None,
            speed_m_s: Vector2::zeros(),
            up: Vector3::z(),
            rate_bias_rad_s: Vector2::zeros(),
            acceleration_bias_m_s2: Vector2::zeros(),
            way_m: Vector2::zeros(),
            covariance: Covariance::zeros(),
            lag_ns: 0,
            lag_rad: 0.0,
            integral_m_s: Vector2::zeros(),
            is_still: false,
            stood_m_s: None,
            at_scan: None,
            nis: 0.0,
            compared_s: 0.0,
        }
    }

    /// Forgets everything: what was integrated belongs to another time.
    pub fn restart(&mut self) {
        (self.last, self.at_scan, self.stood_m_s) = (None, None, None);
        (self.is_still, self.compared_s, self.nis) = (false, 0.0, 0.0);
    }

    /// Takes a sample in the robot's frame; of the rate only that about z is without its bias.
    pub fn push(&mut self, stamp_ns: i64, rate_rad_s: Vector3<f64>, force_m_s2: Vector3<f64>) {
        let Some((last_ns, last_m_s2)) = self.last else {
            self.start(stamp_ns, force_m_s2);
            return;
        };
        let dt_ns = stamp_ns.saturating_sub(last_ns);
        let dt_s = dt_ns as f64 * 1e-9;
        let mut rate_rad_s = rate_rad_s;
        let mut level = rate_rad_s.fixed_rows_mut::<2>(0);
        level -= self.rate_bias_rad_s;
        // The vertical turns against the robot.
        let turned = self.up - rate_rad_s.cross(&self.up) * dt_s;
        self.up = turned
            .try_normalize(f64::MIN_POSITIVE)
            .unwrap_or_else(Vector3::z);
        let change_m_s2 =
            force_m_s2.xy() - self.acceleration_bias_m_s2 - self.up.xy() * GRAVITY_M_S2
                + Vector2::new(self.speed_m_s.y, -self.speed_m_s.x) * rate_rad_s.z;
        let change_m_s = (last_m_s2 + change_m_s2) * (0.5 * dt_s);
        let before_m_s = self.level_speed_m_s();
        self.way_m +=
            before_m_s * dt_s + Vector2::new(self.way_m.y, -self.way_m.x) * (rate_rad_s.z * dt_s);
        self.speed_m_s += change_m_s;
        self.integral_m_s += self.level_speed_m_s() - before_m_s;
        self.last = Some((stamp_ns, change_m_s2));
        self.lag_ns = self.lag_ns.saturating_add(dt_ns);
        self.lag_rad += rate_rad_s.z * dt_s;
        if self.lag_ns >= STEP_NS {
            self.propagate();
        }
    }

    /// The speed of the robot's shadow in the level plane, which the radar's poses are in.
    fn level_speed_m_s(&self) -> Vector2<f64> {
        let cosines = self.up.xy().map(|slope| (1.0 - slope * slope).sqrt());
        self.speed_m_s.component_mul(&cosines)
    }

    /// The first sample shows the vertical, more or less.
    fn start(&mut self, stamp_ns: i64, force_m_s2: Vector3<f64>) {
        if !is_gravity(force_m_s2) {
            return;
        }
        self.up = force_m_s2.normalize();
        self.speed_m_s = Vector2::zeros();
        self.rate_bias_rad_s = Vector2::zeros();
        self.acceleration_bias_m_s2 = Vector2::zeros();
        self.way_m = Vector2::zeros();
        (self.lag_ns, self.lag_rad, self.integral_m_s) = (0, 0.0, Vector2::zeros());
        let sigmas = [
            FIRST_SPEED_SIGMA_M_S,
            FIRST_VERTICAL_SIGMA,
            self.gyro_bias_sigma_rad_s,
            ACCELERATION_BIAS_SIGMA_M_S2,
            FIRST_WAY_SIGMA_M,
        ];
        let variances = SVector::from_fn(|i, _| sigmas.get(i / 2).map_or(0.0, |s| s * s));
        self.covariance = Covariance::from_diagonal(&variances);
        self.last = Some((stamp_ns, Vector2::zeros()));
    }

    /// Moves the covariance on by the time that it lags behind.
    fn propagate(&mut self) {
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
        self.covariance = f * self.covariance * f.transpose();
        let densities = [ACCELERATION_NOISE, self.gyro_noise, self.gyro_bias_walk];
        for (i, density) in densities.into_iter().enumerate() {
            for axis in 0..2 {
                self.covariance[(2 * i + axis, 2 * i + axis)] += density * density * dt_s;
            }
        }
    }

    /// One scalar measurement of a sum of states, `by` their shares.
    fn update(&mut self, by: &SVector<f64, STATES>, innovation: f64, sigma: f64) {
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
        self.up = (self.up + moved)
            .try_normalize(f64::MIN_POSITIVE)
            .unwrap_or_else(Vector3::z);
    }

    /// A window without motion shows the vertical, the gyro's bias and that the robot stands. An
    /// even acceleration looks the same, but not where the vertical is known.
    pub fn observe_still(&mut self, still: &StandstillBias) {
        if !is_gravity(still.gravity_m_s2) {
            // What is taken out would not be gravity: it never proves true.
            self.restart();
            return;
        }
        if self.last.is_none() {
            return;
        }
        let shown = still.gravity_m_s2.normalize().xy();
        let by_slope = |axis: usize| {
            let mut by = SVector::zeros();
            by[VERTICAL + axis] = 1.0;
            by[ACCELERATION_BIAS + axis] = 1.0 / GRAVITY_M_S2;
            by
        };
        let expected = self.up.xy() + self.acceleration_bias_m_s2 / GRAVITY_M_S2;
        let off = shown - expected;
        let scale_2 = self.nis.max(1.0);
        let sigmas_2 = |innovation: f64, by: &SVector<f64, STATES>, sigma: f64| {
            let variance = by.dot(&(self.covariance * by)) + sigma * sigma;
            innovation * innovation / (variance * scale_2)
        };
        let mut by_speed = SVector::zeros();
        by_speed[SPEED] = 1.0;
        self.is_still = sigmas_2(off.x, &by_slope(0), STILL_VERTICAL_SIGMA)
            .max(sigmas_2(off.y, &by_slope(1), STILL_VERTICAL_SIGMA))
            .max(sigmas_2(self.speed_m_s.x, &by_speed, STILL_SPEED_SIGMA_M_S))
            <= GATE_SIGMAS * GATE_SIGMAS;
        if !self.is_still {
            return;
        }
        for axis in 0..2 {
            self.update(&by_slope(axis), off[axis], STILL_VERTICAL_SIGMA);
            let unit = |at: usize| {
                let mut by = SVector::zeros();
                by[at + axis] = 1.0;
                by
            };
            let moving = -self.speed_m_s[axis];
            self.update(&unit(SPEED), moving, STILL_SPEED_SIGMA_M_S);
            let bias_off = still.bias_rad_s[axis] - self.rate_bias_rad_s[axis];
            self.update(&unit(RATE_BIAS), bias_off, still.sigma_rad_s[axis]);
        }
        self.stood_m_s = Some(self.integral_m_s.x);
    }

    /// The window has motion.
    pub fn observe_motion(&mut self) {
        self.is_still = false;
    }

    /// Whether the robot stands: it has not gained speed since a standstill that lasts.
    pub fn stands(&self) -> bool {
        let gained = self
            .stood_m_s
            .map(|stood_m_s| (self.integral_m_s.x - stood_m_s).abs());
        self.is_still && gained.is_some_and(|gained_m_s| gained_m_s < DEPARTED_M_S)
    }

    /// A scan ends here; `None` where the radar does not fix it.
    pub fn observe_scan(&mut self, stamp_ns: i64, fix: Option<&RadarFix>) {
        if self.last.is_none() {
            return;
        }
        self.propagate();
        let since_ns = self
            .at_scan
            .map_or(0, |last| stamp_ns.saturating_sub(last.stamp_ns));
        let odom_from_last = self
            .at_scan
            .and_then(|last| last.odom_from_base)
            .filter(|_| (1..STEP_MAX_NS).contains(&since_ns));
        if let Some((odom_from_last, fix)) = odom_from_last.zip(fix) {
            let way_m = -fix.pose.between(&odom_from_last).translation();
            self.compare(way_m, fix.sigma_m, since_ns as f64 * 1e-9);
        } else {
            // The way begins anew, at a scan that may be as far off as one is.
            self.way_m = Vector2::zeros();
            for axis in [WAY, WAY + 1] {
                self.covariance.row_mut(axis).fill(0.0);
                self.covariance.column_mut(axis).fill(0.0);
                self.covariance[(axis, axis)] = FIRST_WAY_SIGMA_M * FIRST_WAY_SIGMA_M;
            }
        }
        self.at_scan = Some(AtScan {
            stamp_ns,
            integral_m_s: self.integral_m_s,
            variances: self.speed_variances(),
            odom_from_base: fix.map(|fix| fix.pose),
        });
    }

    /// Compares the way since the last scan with the radar's, in the robot's frame.
    fn compare(&mut self, way_m: Vector2<f64>, sigma_m: [f64; 2], since_s: f64) {
        for (axis, sigma_m) in sigma_m.into_iter().enumerate() {
            let mut by = SVector::zeros();
            by[WAY + axis] = 1.0;
            let innovation = way_m[axis] - self.way_m[axis];
            if axis == 0 {
                let variance = self.covariance[(WAY + axis, WAY + axis)] + sigma_m * sigma_m;
                self.compared_s += since_s;
                let share = since_s / self.compared_s.min(MEMORY_S);
                self.nis += share * (innovation * innovation / variance - self.nis);
            }
            self.update(&by, innovation, sigma_m);
        }
        self.way_m -= way_m;
    }

    /// Variances of the speed, (m/s)^2, by what it differs by if that is more.
    fn speed_variances(&self) -> [f64; 2] {
        [SPEED, SPEED + 1].map(|axis| self.covariance[(axis, axis)] * self.nis.max(1.0))
    }

    /// The speed, where the IMU has proved true and knows that forward well enough.
    pub fn speed(&self) -> Option<Speed> {
        let sigma_m_s = self.speed_variances().map(f64::sqrt);
        let [forward_sigma_m_s, _] = sigma_m_s;
        let carries = self.compared_s >= COMPARED_MIN_S
            && self.nis <= NIS_MAX
            && forward_sigma_m_s < CARRIED_SIGMA_MAX_M_S;
        carries.then(|| Speed {
            value_m_s: self.level_speed_m_s().into(),
            sigma_m_s,
        })
    }

    /// How the speed changed since the last scan, where [`Self::speed`] carries it.
    pub fn change(&self) -> Option<Speed> {
        let (last, (now_ns, _)) = (self.at_scan?, self.last?);
        self.speed()?;
        let dt_s = now_ns.saturating_sub(last.stamp_ns).max(0) as f64 * 1e-9;
        let floor = ACCELERATION_NOISE * ACCELERATION_NOISE * dt_s;
        let [now, then] = [self.speed_variances(), last.variances];
        Some(Speed {
            value_m_s: (self.integral_m_s - last.integral_m_s).into(),
            sigma_m_s: [now[0] - then[0], now[1] - then[1]]
                .map(|grown| CORRELATED * grown.max(floor).sqrt()),
        })
    }
}

/// Whether a force is that of gravity on a robot that is upright, m/s^2.
fn is_gravity(force_m_s2: Vector3<f64>) -> bool {
    let length_m_s2 = force_m_s2.norm();
    (length_m_s2 - GRAVITY_M_S2).abs() < LENGTH_TOLERANCE_M_S2
        && force_m_s2.z > UPRIGHT_MIN * length_m_s2
}

#[cfg(test)]
mod tests;

//! The speed that an IMU carries on where the radar shows none: a Kalman filter of speed, vertical
//! and biases, which the radar's speed corrects as long as there is one.

mod inertial_state;
mod quietness;
mod unaided;

use inertial_state::{
    ACCELERATION_NOISE, InertialState, RATE_BIAS, SPEED, WAY, is_gravity, single,
};
use nalgebra::{Vector2, Vector3};
use quietness::Quietness;
use randt_config::Odometry;
use randt_filter::StandstillBias;
use randt_geometry::Pose2;
use randt_persist::persist;
use unaided::Unaided;

/// How well a still window shows the vertical, as a slope, and that the robot stands, m/s: it may
/// be the end of a slow stop.
const STILL_VERTICAL_SIGMA: f64 = 0.006;
const STILL_SPEED_SIGMA_M_S: f64 = 0.03;
/// How well wheels show the speed, forward and to the left, m/s: it is their mean since the last
/// scan, and they slip.
const WHEEL_SIGMA_M_S: [f64; 2] = [0.1, 0.05];
/// What differs by more standard deviations is no standstill but an even acceleration.
const GATE_SIGMAS: f64 = 3.0;
/// Speed that a robot has not gained while it stands, m/s.
const DEPARTED_M_S: f64 = 0.05;
/// Longest time between two scans whose way is compared, ns.
const STEP_MAX_NS: i64 = 2_000_000_000;
/// Standard deviations from which a comparison is off, how many of the last ones are remembered,
/// and how many of them are not chance.
const OFF_SIGMAS: f64 = 3.0;
const OFF_SCANS: u32 = 10;
const OFF_MIN: u32 = 3;
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

/// A speed forward and to the left, or a change of speed.
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

/// Carries the speed by accelerometer and gyro.
#[derive(Clone, Debug)]
pub struct InertialSpeed {
    state: InertialState,
    unaided: Unaided,
    /// Stamp of the last sample, ns; `None` before the first one that shows gravity.
    last_ns: Option<i64>,
    /// All changes of the speed, without corrections, m/s.
    integral_m_s: Vector2<f64>,
    /// Whether the last window was still, and the integral at the last one that was, m/s.
    is_still: bool,
    stood_m_s: Option<f64>,
    quietness: Quietness,
    at_scan: Option<AtScan>,
    /// Mean square of the forward innovations in their standard deviations, and for how long they
    /// were compared, s.
    nis: f64,
    compared_s: f64,
    /// The last [`OFF_SCANS`] comparisons, the newest one the lowest bit: 1 where radar and IMU
    /// did not agree.
    off: u32,
}

persist!(InertialSpeed {
    state,
    unaided,
    last_ns,
    integral_m_s,
    is_still,
    stood_m_s,
    quietness,
    at_scan,
    nis,
    compared_s,
    off,
});

impl InertialSpeed {
    /// Nothing known yet.
    pub fn new(odometry: &Odometry) -> Self {
        Self {
            state: InertialState::new(odometry),
            unaided: Unaided::new(odometry),
            last_ns: None,
            integral_m_s: Vector2::zeros(),
            is_still: false,
            stood_m_s: None,
            quietness: Quietness::default(),
            at_scan: None,
            nis: 0.0,
            compared_s: 0.0,
            off: 0,
        }
    }

    /// Forgets everything: what was integrated belongs to another time.
    pub fn restart(&mut self) {
        (self.last_ns, self.at_scan, self.stood_m_s) = (None, None, None);
        (self.is_still, self.compared_s, self.nis) = (false, 0.0, 0.0);
        self.off = 0;
        self.unaided.restart();
    }

    /// Takes a sample in the robot's frame; of the rate only that about z is without its bias.
    pub fn push(&mut self, stamp_ns: i64, rate_rad_s: Vector3<f64>, force_m_s2: Vector3<f64>) {
        match self.last_ns {
            Some(last_ns) => {
                let dt_ns = stamp_ns.saturating_sub(last_ns);
                self.integral_m_s += self.state.integrate(dt_ns, rate_rad_s, force_m_s2);
                self.unaided.integrate(dt_ns, rate_rad_s, force_m_s2);
            }
            None if is_gravity(force_m_s2) => {
                self.state.start(force_m_s2);
                self.integral_m_s = Vector2::zeros();
            }
            None => return,
        }
        self.last_ns = Some(stamp_ns);
    }

    /// A window without motion shows the vertical, the gyro's bias and that the robot stands.
    /// Where the radar does not show that too, it has to be as quiet as the last one that it did;
    /// gives whether it is.
    pub fn observe_still(&mut self, still: &StandstillBias) -> bool {
        if !is_gravity(still.gravity_m_s2) {
            // What is taken out would not be gravity: it never proves true.
            self.restart();
            return true;
        }
        if self.last_ns.is_none() {
            return true;
        }
        let is_fixed = self
            .at_scan
            .is_some_and(|last| last.odom_from_base.is_some());
        let fits = self.fits(still);
        self.is_still = self.quietness.admits(still.spread_m_s2, fits, is_fixed);
        if self.is_still && !fits {
            // The filter was sure of what is wrong.
            self.state.start(still.gravity_m_s2);
        }
        if !self.is_still {
            return is_fixed;
        }
        let state = &mut self.state;
        let (by_slope, off) = state.shown_slope(still);
        for axis in 0..2 {
            state.update(&by_slope[axis], off[axis], STILL_VERTICAL_SIGMA);
            let moving_m_s = -state.speed_m_s[axis];
            state.update(&single(SPEED + axis), moving_m_s, STILL_SPEED_SIGMA_M_S);
            let bias_off = still.bias_rad_s[axis] - state.rate_bias_rad_s[axis];
            state.update(&single(RATE_BIAS + axis), bias_off, still.sigma_rad_s[axis]);
        }
        self.stood_m_s = Some(self.integral_m_s.x);
        self.unaided.stop();
        true
    }

    /// Whether a still window fits what is known: an even acceleration looks the same, but not
    /// where the vertical is known.
    fn fits(&self, still: &StandstillBias) -> bool {
        let state = &self.state;
        let (by_slope, off) = state.shown_slope(still);
        let measured = [
            (by_slope[0], off.x, STILL_VERTICAL_SIGMA),
            (by_slope[1], off.y, STILL_VERTICAL_SIGMA),
            (single(SPEED), -state.speed_m_s.x, STILL_SPEED_SIGMA_M_S),
        ];
        let scale_2 = self.nis.max(1.0);
        measured.iter().all(|(by, innovation, sigma)| {
            let variance = (state.variance(by) + sigma * sigma) * scale_2;
            innovation * innovation <= GATE_SIGMAS * GATE_SIGMAS * variance
        })
    }

    /// Whether radar and IMU do not agree on how fast the robot is.
    pub fn disagrees(&self) -> bool {
        self.unaided.differs() || self.off.count_ones() >= OFF_MIN
    }

    /// By how much the forward speed has changed since the last scan, m/s, also where the speed
    /// itself is not known.
    pub fn gained_m_s(&self) -> Option<f64> {
        let last = self.at_scan.filter(|_| self.last_ns.is_some())?;
        Some(self.integral_m_s.x - last.integral_m_s.x)
    }

    /// Wheels that are believed show the speed, forward and to the left, where the radar does not:
    /// a turn would else make a forward speed of the one to the left.
    pub fn observe_wheels(&mut self, speed_m_s: [f64; 2]) {
        if self.last_ns.is_none() {
            return;
        }
        self.state.propagate();
        for (axis, (speed_m_s, sigma)) in speed_m_s.into_iter().zip(WHEEL_SIGMA_M_S).enumerate() {
            let innovation = speed_m_s - self.state.speed_m_s[axis];
            self.state.update(&single(SPEED + axis), innovation, sigma);
        }
        self.unaided.stop();
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
        if self.last_ns.is_none() {
            return;
        }
        self.state.propagate();
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
            self.state.begin_way();
        }
        if self.compared_s >= COMPARED_MIN_S {
            let scale = self.nis.max(1.0);
            // What the radar said over a span is taken back where the IMU alone does not agree.
            if let Some(unaided) = self.unaided.observe_scan(stamp_ns, fix, &self.state, scale) {
                self.state = unaided;
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
        let state = &mut self.state;
        for (axis, sigma_m) in sigma_m.into_iter().enumerate() {
            let by = single(WAY + axis);
            let innovation = way_m[axis] - state.way_m[axis];
            if axis == 0 {
                let variance = state.variance(&by) + sigma_m * sigma_m;
                self.compared_s += since_s;
                let share = since_s / self.compared_s.min(MEMORY_S);
                let sigmas_2 = innovation * innovation / variance;
                self.nis += share * (sigmas_2 - self.nis);
                let is_off =
                    self.compared_s >= COMPARED_MIN_S && sigmas_2 > OFF_SIGMAS * OFF_SIGMAS;
                self.off = (self.off << 1 | u32::from(is_off)) & ((1 << OFF_SCANS) - 1);
            }
            state.update(&by, innovation, sigma_m);
        }
        state.way_m -= way_m;
    }

    /// Variances of the speed, (m/s)^2, by what it differs by if that is more.
    fn speed_variances(&self) -> [f64; 2] {
        [SPEED, SPEED + 1].map(|axis| self.state.covariance[(axis, axis)] * self.nis.max(1.0))
    }

    /// The speed, where the IMU has proved true and knows that forward well enough.
    pub fn speed(&self) -> Option<Speed> {
        let sigma_m_s = self.speed_variances().map(f64::sqrt);
        let [forward_sigma_m_s, _] = sigma_m_s;
        let carries = self.compared_s >= COMPARED_MIN_S
            && self.nis <= NIS_MAX
            && forward_sigma_m_s < CARRIED_SIGMA_MAX_M_S;
        carries.then(|| Speed {
            value_m_s: self.state.level_speed_m_s().into(),
            sigma_m_s,
        })
    }

    /// How the speed changed since the last scan, where [`Self::speed`] carries it.
    pub fn change(&self) -> Option<Speed> {
        let (last, now_ns) = (self.at_scan?, self.last_ns?);
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

#[cfg(test)]
mod tests;

//! Whether wheels say the truth, and by how much more: what they measure is set against the radar
//! where it fixes the way, and against the IMU, whose speed changes as theirs does.

use super::twist_integrator::MeasuredWay;
use crate::sliding_window::TwistWay;
use nalgebra::{Matrix3, Vector3};
use randt_geometry::Pose2;
use randt_persist::persist;

/// Scale and slip of wheels of which nothing is known, one standard deviation: tyres wear and are
/// pumped up.
const FIRST_SCALE_SIGMA: f64 = 0.05;
const FIRST_SLIP_SIGMA: f64 = 0.05;
/// How they walk, per square root of a metre: load and ground change.
const SCALE_WALK: f64 = 0.0005;
const SLIP_WALK: f64 = 0.002;
/// Yaw rate from which wheels slip as in a curve, rad/s.
const CURVE_RAD_S: f64 = 0.2;
/// How far off the radar has a scan whose way its cells fix, m (sound drives: 0.02 to 0.03 m for
/// the way between two), and what its way errs by, per square root of a metre.
const FIX_SIGMA_M: f64 = 0.02;
const WAY_WALK_M: f64 = 0.01;
/// Radar and wheels are compared over this time, s: a way that is long against the error of a fix.
const COMPARED_S: f64 = 1.0;
/// A way is fixed where it was for this long before, s: what fixes it now and then by chance holds
/// the robot back.
const FIXED_S: f64 = 3.0;
/// Way within it that proves something, m: wheels that are stuck agree with a robot that stands.
const PROOF_M: f64 = 0.2;
/// What wheels may be off by over that time without being wrong, as a share of the way.
const TOLERANCE: f64 = 0.1;
/// Wheels that are off by more standard deviations are wrong.
const GATE_SIGMAS: f64 = 3.0;

/// Changes of speed over up to this many scans are compared: a second.
const CHANGES: usize = 5;
/// What a change of speed is off by: a reading of either, m/s, share of the change by tilt and
/// scale, and over time by the accelerometer's bias, m/s^2.
const CHANGE_SIGMA_M_S: f64 = 0.08;
const CHANGE_SHARE: f64 = 0.1;
const ACCELERATION_SIGMA_M_S2: f64 = 0.06;
/// A change that proves something, m/s, and the share of it by which wheels may be off then.
const PROOF_M_S: f64 = 0.3;
const PROOF_SHARE: f64 = 0.3;

/// Proofs in a row without which wheels are not used: none is by chance; of wheels that were wrong
/// once, more.
const PROOFS_MIN: u32 = 1;
const PROOFS_AFTER_LIE: u32 = 3;

/// Standard deviation of a step's way beside what is not known of scale and slip: floor, m, and
/// share of the way. Wheels whose steps count much less let the walls of a tunnel, cut by the
/// grid, hold the robot back, which turns it.
const STEP_SIGMA_M: f64 = 0.004;
const STEP_SHARE: f64 = 0.02;
/// Speed to the left of a robot whose wheels measure none, m/s: it slips a centimetre a metre.
const LEFT_SIGMA_M_S: f64 = 0.03;

/// What wheels said when they were wrong, and what was true.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lie {
    /// By the wheels, m/s.
    pub wheels_m_s: f64,
    /// By radar or IMU, m/s.
    pub truth_m_s: f64,
}

/// How fast the robot was up to a scan.
#[derive(Clone, Copy, Debug, Default)]
struct SpeedAtScan {
    /// By the wheels, in the mean since the scan before, m/s.
    wheels_m_s: f64,
    /// By the IMU against some zero, in the mean and at the scan, m/s.
    mean_imu_m_s: f64,
    imu_m_s: f64,
    /// Since the first one, s.
    at_s: f64,
}

persist!(SpeedAtScan {
    wheels_m_s,
    mean_imu_m_s,
    imu_m_s,
    at_s
});

/// A way that the radar fixes, up to now.
#[derive(Clone, Copy, Debug, Default)]
struct ComparedWay {
    dt_s: f64,
    radar_m: f64,
    wheels_m: f64,
    curve_m: f64,
}

persist!(ComparedWay {
    dt_s,
    radar_m,
    wheels_m,
    curve_m
});

/// Estimates scale and slip of wheels, and finds them out. Its fields are a filter of three and
/// what is compared next.
#[derive(Clone, Debug)]
pub struct TwistMonitor {
    /// Way of the robot by that of the wheels; how much that is less in curves; error of the last
    /// fix along the way, m.
    state: Vector3<f64>,
    covariance: Matrix3<f64>,
    compared: ComparedWay,
    /// Where the radar had the last scan, if it fixed it, and for how long it has, s.
    last_fix: Option<Pose2>,
    fixed_s: f64,
    /// The last speeds, the newest one last.
    speeds: Vec<SpeedAtScan>,
    /// Proofs in a row, and those without which wheels are not used.
    proofs: u32,
    proofs_min: u32,
}

persist!(TwistMonitor {
    state,
    covariance,
    compared,
    last_fix,
    fixed_s,
    speeds,
    proofs,
    proofs_min,
} sound is_sound);

impl TwistMonitor {
    /// Wheels of which nothing is known.
    pub fn new() -> Self {
        let sigmas = Vector3::new(FIRST_SCALE_SIGMA, FIRST_SLIP_SIGMA, FIX_SIGMA_M);
        Self {
            state: Vector3::new(1.0, 0.0, 0.0),
            covariance: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)),
            compared: ComparedWay::default(),
            last_fix: None,
            fixed_s: 0.0,
            speeds: Vec::with_capacity(CHANGES + 1),
            proofs: 0,
            proofs_min: PROOFS_MIN,
        }
    }

    fn is_sound(&self) -> bool {
        self.speeds.len() <= CHANGES + 1 && self.proofs.max(self.proofs_min) <= u32::MAX / 2
    }

    /// Another frame begins: what was compared belongs to the old one.
    pub fn restart(&mut self) {
        self.last_fix = None;
        self.fixed_s = 0.0;
        self.begin_way();
        self.speeds.clear();
    }

    /// Whether wheels were proved, since they were wrong the last time.
    fn are_proved(&self) -> bool {
        self.proofs >= self.proofs_min
    }

    /// Whether wheels were wrong, and were not proved since.
    pub fn are_refused(&self) -> bool {
        self.proofs_min == PROOFS_AFTER_LIE && !self.are_proved()
    }

    /// The way since the last scan, where wheels can be believed. `turn_rad`: by the gyro.
    pub fn way(&self, measured: &MeasuredWay, turn_rad: f64) -> Option<TwistWay> {
        if !self.are_proved() {
            return None;
        }
        let [forward_m, left_m] = measured.way_m;
        let by = Vector3::new(forward_m, curve_m(measured, turn_rad), 0.0);
        let model = (by.transpose() * self.covariance * by).x.max(0.0).sqrt();
        let [noise_m, left_noise_m] = measured.sigma_m_s.map(|sigma| sigma * measured.dt_s);
        let squares = [STEP_SIGMA_M, noise_m, STEP_SHARE * forward_m, model];
        let slides_m = left_noise_m.max(LEFT_SIGMA_M_S * measured.dt_s);
        Some(TwistWay {
            way_m: [by.dot(&self.state), left_m * self.state.x],
            sigma_m: [squares.iter().map(|s| s * s).sum::<f64>().sqrt(), slides_m],
        })
    }

    /// A scan's wheels, and what the IMU's speed has gained since the scan before. Gives what
    /// wheels said where the two do not agree.
    pub fn observe_change(
        &mut self,
        measured: Option<&MeasuredWay>,
        gained_m_s: Option<f64>,
    ) -> Option<Lie> {
        let Some((measured, gained_m_s)) = measured.zip(gained_m_s) else {
            self.speeds.clear();
            return None;
        };
        let last = self.speeds.last().copied().unwrap_or_default();
        if self.speeds.len() > CHANGES {
            self.speeds.remove(0);
        }
        let now = SpeedAtScan {
            wheels_m_s: self.state.x * measured.speed_m_s(),
            mean_imu_m_s: last.imu_m_s + 0.5 * gained_m_s,
            imu_m_s: last.imu_m_s + gained_m_s,
            at_s: last.at_s + measured.dt_s,
        };
        let mut has_proved = false;
        for before in &self.speeds {
            let imu_m_s = now.mean_imu_m_s - before.mean_imu_m_s;
            let wheels_m_s = now.wheels_m_s - before.wheels_m_s;
            let bias_m_s = ACCELERATION_SIGMA_M_S2 * (now.at_s - before.at_s);
            let share_m_s = CHANGE_SHARE * imu_m_s;
            let sigma_2 =
                CHANGE_SIGMA_M_S * CHANGE_SIGMA_M_S + bias_m_s * bias_m_s + share_m_s * share_m_s;
            let off_m_s = wheels_m_s - imu_m_s;
            if off_m_s * off_m_s > GATE_SIGMAS * GATE_SIGMAS * sigma_2 {
                let lie = Lie {
                    wheels_m_s: now.wheels_m_s,
                    truth_m_s: before.wheels_m_s + imu_m_s,
                };
                self.speeds.clear();
                self.refute();
                return Some(lie);
            }
            has_proved |= imu_m_s.abs() >= PROOF_M_S
                && off_m_s.abs() <= CHANGE_SIGMA_M_S + PROOF_SHARE * imu_m_s.abs();
        }
        if has_proved {
            // One change proves once.
            self.speeds.clear();
            self.prove();
        }
        self.speeds.push(now);
        None
    }

    /// A scan was estimated: where the radar has it, if it fixes the way. Gives what wheels said
    /// where the two do not agree.
    pub fn observe_scan(
        &mut self,
        measured: Option<&(MeasuredWay, f64)>,
        fix: Option<Pose2>,
    ) -> Option<Lie> {
        let last_fix = std::mem::replace(&mut self.last_fix, fix);
        let Some(((last, now), (measured, turn_rad))) = last_fix.zip(fix).zip(measured) else {
            self.fixed_s = 0.0;
            self.begin_way();
            return None;
        };
        self.fixed_s += measured.dt_s;
        if self.fixed_s < FIXED_S {
            return None;
        }
        let compared = &mut self.compared;
        // Backwards from here, so that it is in the frame of the newer scan, as that of the IMU.
        compared.radar_m -= now.between(&last).x_m;
        compared.dt_s += measured.dt_s;
        compared.wheels_m += measured.way_m[0];
        compared.curve_m += curve_m(measured, *turn_rad);
        if compared.dt_s < COMPARED_S {
            return None;
        }
        let way = std::mem::take(&mut self.compared);
        self.compare(&way)
    }

    /// The next way begins at a fix of its own.
    fn begin_way(&mut self) {
        self.compared = ComparedWay::default();
        self.state.z = 0.0;
        self.covariance.row_mut(2).fill(0.0);
        self.covariance.column_mut(2).fill(0.0);
        self.covariance.m33 = FIX_SIGMA_M * FIX_SIGMA_M;
    }

    /// The fix at its end errs by what the radar's way is longer than the wheels', and by what the
    /// fix at its beginning erred by; and it errs by little.
    fn compare(&mut self, way: &ComparedWay) -> Option<Lie> {
        let mut by = Matrix3::identity();
        (by.m31, by.m32) = (-way.wheels_m, -way.curve_m);
        let moved_m = way.wheels_m.abs();
        let walks = Vector3::new(SCALE_WALK, SLIP_WALK, WAY_WALK_M);
        let walked = Matrix3::from_diagonal(&(walks.component_mul(&walks) * moved_m));
        let mut state = by * self.state;
        state.z += way.radar_m;
        let covariance = by * self.covariance * by.transpose() + walked;
        let variance = covariance.m33 + FIX_SIGMA_M * FIX_SIGMA_M;
        let longer_m = way.radar_m.abs().max(moved_m);
        let tolerated_m = TOLERANCE * longer_m;
        let expected = variance + tolerated_m * tolerated_m;
        if state.z * state.z > GATE_SIGMAS * GATE_SIGMAS * expected {
            self.begin_way();
            self.refute();
            return Some(Lie {
                wheels_m_s: way.wheels_m / way.dt_s,
                truth_m_s: way.radar_m / way.dt_s,
            });
        }
        let gain = covariance.column(2) / variance;
        self.state = state - gain * state.z;
        let updated = covariance - gain * covariance.row(2);
        // Rounding must not make it lopsided.
        self.covariance = (updated + updated.transpose()) * 0.5;
        if way.radar_m.abs() >= PROOF_M {
            self.prove();
        }
        None
    }

    fn prove(&mut self) {
        self.proofs = self.proofs.saturating_add(1).min(PROOFS_AFTER_LIE);
    }

    fn refute(&mut self) {
        (self.proofs, self.proofs_min) = (0, PROOFS_AFTER_LIE);
    }
}

/// Way in curves: that by which wheels slip as in one.
fn curve_m(measured: &MeasuredWay, turn_rad: f64) -> f64 {
    let share = turn_rad.abs() / (CURVE_RAD_S * measured.dt_s);
    measured.way_m[0] * share.min(1.0)
}

#[cfg(test)]
mod tests;

//! What scans still want to turn, set against what a gyro that is late, or of another scale or
//! bias, makes of the yaw.

use crate::sliding_window::WindowScan;
use nalgebra::{Matrix2, Matrix3, Vector3};
use randt_messages::Localizability as Seen;
use randt_persist::persist;

/// Memory, scans: some turns to both sides.
const MEMORY_SCANS: f64 = 200.0;
/// Residuals of scans in a row hang together: that many count as one.
const CORRELATED: f64 = 5.0;
/// What a gyro may show of delay (s), scale and bias (rad/s) before any scan, one standard
/// deviation.
const FIRST_SIGMAS: [f64; 3] = [0.3, 0.02, 0.0175];
/// The map takes in the newest scans, and so gives way to the estimate about as much as that does
/// to the map.
const MAP_GIVES_WAY: f64 = 2.0;
/// What differs by more standard deviations is not chance: sound drives show at most 1.9.
const SHOWN_SIGMAS: f64 = 3.0;
/// A delay that is said, s: half of what costs a robot a degree in its turns.
const DELAY_MIN_S: f64 = 0.02;
/// A scale that is wrong, twice as much as data sheets allow.
const SCALE_MIN: f64 = 0.01;

/// What is known of a scan that is compared.
#[derive(Clone, Copy, Debug)]
pub struct ScanEvidence {
    /// Nothing else was found against it.
    pub is_clear: bool,
    /// It does not fit.
    pub is_poor: bool,
    /// Variance of its yaw as it was estimated, rad^2.
    pub yaw_variance: f64,
    /// Information of one of its correspondences.
    pub correspondence_information: f64,
}

/// The gyro's part in a scan, since the one before.
#[derive(Clone, Copy, Debug, Default)]
pub struct GyroStep {
    /// Its turn without bias, rad.
    pub turn_rad: f64,
    /// Its rate at the scan, without bias, rad/s.
    pub rate_rad_s: f64,
    /// Time, s.
    pub dt_s: f64,
}

/// What the scan by itself wants.
#[derive(Clone, Copy, Debug, Default)]
pub struct WantedTurn {
    /// The turn, rad.
    pub turn_rad: f64,
    /// Information of the scan about its yaw, 1/rad^2.
    pub information: f64,
    /// Variance of the yaw as it was estimated, rad^2.
    pub variance: f64,
}

impl GyroStep {
    /// Of a scan that the gyro is used for.
    pub fn from_scan(scan: &WindowScan) -> Option<Self> {
        let (gyro, bias_rad_s) = (scan.gyro?, scan.state.bias_rad_s);
        Some(Self {
            turn_rad: gyro.turn.angle_rad - bias_rad_s * scan.dt_s,
            rate_rad_s: gyro.rate_rad_s - bias_rad_s,
            dt_s: scan.dt_s,
        })
    }
}

impl WantedTurn {
    /// At a scan's present state, where it sees every direction.
    pub fn from_scan(scan: &WindowScan, evidence: &ScanEvidence) -> Option<Self> {
        if scan.localizability.seen != Seen::Full {
            return None;
        }
        // The yaw of -H^-1 g, the position eliminated.
        let (information, gradient) = (&scan.ndt.pose, &scan.ndt.pose_gradient);
        let position: Matrix2<f64> = information.fixed_view::<2, 2>(0, 0).into_owned();
        let by_yaw = information.fixed_view::<2, 1>(0, 2).into_owned();
        let inverse = position.try_inverse()?;
        let yaw_information = information.m33 - by_yaw.dot(&(inverse * by_yaw));
        let yaw_gradient = gradient.z - by_yaw.dot(&(inverse * gradient.xy()));
        let turn_rad = -yaw_gradient / yaw_information;
        turn_rad.is_finite().then_some(Self {
            turn_rad,
            information: yaw_information * evidence.correspondence_information,
            variance: evidence.yaw_variance,
        })
    }
}

/// Least squares over the last scans. Each error of the gyro moves the yaw from scan to scan; a
/// scan takes back its share of all that has come together, and wants to take back the rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct YawRegression {
    /// What a delay of 1 s, a scale that is off by 1 and a bias of 1 rad/s have made of the yaw.
    effects: Vector3<f64>,
    last_rate_rad_s: Option<f64>,
    information: Matrix3<f64>,
    gradient: Vector3<f64>,
}

persist!(YawRegression {
    effects,
    last_rate_rad_s,
    information,
    gradient
});

impl YawRegression {
    /// Takes a scan; where it is not compared, the next one begins anew.
    pub fn push(&mut self, step: Option<&GyroStep>, wanted: Option<&WantedTurn>) {
        let last_rate_rad_s =
            std::mem::replace(&mut self.last_rate_rad_s, step.map(|step| step.rate_rad_s));
        let Some((step, wanted)) = step.zip(wanted) else {
            self.effects = Vector3::zeros();
            return;
        };
        let gained_rad_s = last_rate_rad_s.map_or(0.0, |last| step.rate_rad_s - last);
        let share = (MAP_GIVES_WAY * wanted.variance * wanted.information).clamp(0.0, 1.0);
        self.effects += Vector3::new(gained_rad_s, step.turn_rad, step.dt_s);
        self.effects *= 1.0 - share;
        let kept = 1.0 - 1.0 / MEMORY_SCANS;
        let weighted = self.effects * wanted.information;
        self.information = self.information * kept + weighted * self.effects.transpose();
        self.gradient = self.gradient * kept + weighted * wanted.turn_rad;
    }

    /// Delay, s, and scale (0 where it is right) that are shown.
    pub fn shown(&self) -> (Option<f64>, Option<f64>) {
        let first = FIRST_SIGMAS.map(|sigma| CORRELATED / (sigma * sigma));
        let information = self.information + Matrix3::from_diagonal(&first.into());
        let Some(covariance) = information.try_inverse() else {
            return (None, None);
        };
        let found = covariance * self.gradient;
        let shown = |axis: usize, least: f64| {
            let sigma = (CORRELATED * covariance[(axis, axis)]).sqrt();
            let is_shown = found[axis].abs() > least.max(SHOWN_SIGMAS * sigma);
            is_shown.then_some(found[axis])
        };
        // A gyro that turns too far is to be turned back.
        (shown(0, DELAY_MIN_S), shown(1, SCALE_MIN).map(|off| -off))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::sin;

    const DT_S: f64 = 0.2;
    const INFORMATION: f64 = 1e5;
    /// A tenth of the yaw's error is taken back by the scan and a tenth by the map.
    const VARIANCE: f64 = 0.1 / INFORMATION;

    /// What is shown of a gyro in a drive with turns, whose scans err by a third of a degree.
    fn shown(late_s: f64, ratio: f64) -> (Option<f64>, Option<f64>) {
        let rate_rad_s = |at_s: f64| {
            let slow = sin(0.25 * at_s);
            if slow > 0.3 {
                0.5 * sin(0.5 * at_s)
            } else {
                0.0
            }
        };
        let mut regression = YawRegression::default();
        let (mut off_rad, mut random) = (0.0, 1_u32);
        for number in 0..300 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(random >> 8) / f64::from(1_u32 << 24) - 0.5;
            let at_s = DT_S * f64::from(number);
            let gyro_rad_s = ratio * rate_rad_s(at_s - late_s);
            let step = GyroStep {
                turn_rad: gyro_rad_s * DT_S,
                rate_rad_s: gyro_rad_s,
                dt_s: DT_S,
            };
            off_rad = 0.8 * (off_rad + (gyro_rad_s - rate_rad_s(at_s)) * DT_S);
            let wanted = WantedTurn {
                turn_rad: -off_rad + 0.011 * noise,
                information: INFORMATION,
                variance: VARIANCE,
            };
            regression.push(Some(&step), Some(&wanted));
        }
        regression.shown()
    }

    #[test]
    fn delay_and_scale_differ_and_noise_is_neither() {
        assert_eq!(shown(0.0, 1.0), (None, None));
        let (delay_s, scale) = shown(0.05, 1.0);
        assert!((delay_s.unwrap() - 0.05).abs() < 0.01 && scale.is_none());
        let (delay_s, scale) = shown(-0.1, 1.0);
        assert!((delay_s.unwrap() + 0.1).abs() < 0.02 && scale.is_none());
        let (delay_s, scale) = shown(0.0, 1.03);
        assert!((scale.unwrap() - 0.03).abs() < 0.01 && delay_s.is_none());
    }
}

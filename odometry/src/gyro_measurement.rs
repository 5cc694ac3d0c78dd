//! What the gyro measured during a sweep, and since the scan before it.

use crate::{
    Counters,
    gyro_check::BiasChange,
    gyro_integrator::{GyroIntegrator, GyroTerm, Turn},
    tilt::Tilt,
};
use randt_messages::{ImuUse, SweepHead};

/// Gyro coverage of a sweep may lack this much, s: two samples at 250 Hz.
const UNCOVERED_MAX_S: f64 = 0.01;

/// The gyro's part in the prediction of a scan.
#[derive(Clone, Copy, Debug)]
pub struct GyroMeasurement {
    /// The turn over the sweep and the time since the scan before; `None` without any samples.
    pub turn: Option<Turn>,
    /// That time, ns.
    pub span_ns: (i64, i64),
    /// Whether a sample at or after the sweep's end was used.
    pub reaches_end: bool,
    /// Whether the samples cover the sweep.
    pub covers_sweep: bool,
    /// Roll and pitch; level where the sweep is not covered.
    pub tilt: Tilt,
    /// Yaw rate at the sweep's end, bias and all, where the sweep is covered, rad/s.
    pub rate_rad_s: Option<f64>,
    /// The yaw bias known before, and its standard deviation, rad/s.
    pub bias_rad_s: f64,
    pub bias_sigma_rad_s: f64,
    /// How the bias has changed since the scan before, beside its walk.
    pub bias_change: BiasChange,
    /// The factor between the scan before and this one.
    pub term: Option<GyroTerm>,
}

impl Default for GyroMeasurement {
    /// Without a gyro, whose bias does not matter then.
    fn default() -> Self {
        Self {
            turn: None,
            span_ns: (0, 0),
            reaches_end: false,
            covers_sweep: false,
            tilt: Tilt::default(),
            rate_rad_s: None,
            bias_rad_s: 0.0,
            bias_sigma_rad_s: 1.0,
            bias_change: BiasChange::default(),
            term: None,
        }
    }
}

impl GyroMeasurement {
    /// During a sweep; `last_end_ns` is the end of the scan before in the same frame.
    pub fn during_sweep(
        gyro: Option<&mut GyroIntegrator>,
        sweep: &SweepHead,
        last_end_ns: Option<i64>,
    ) -> Self {
        let Some(gyro) = gyro else {
            return Self::default();
        };
        let end_ns = sweep.end_ns;
        let begin_ns = last_end_ns.map_or(sweep.begin_ns, |last_ns| last_ns.min(sweep.begin_ns));
        let turn = gyro.turn_between(begin_ns, end_ns);
        let covers_sweep = turn.is_some_and(|turn| turn.uncovered_s <= UNCOVERED_MAX_S);
        let rate_and_tilt = gyro.rate_and_tilt(end_ns).filter(|_| covers_sweep);
        let standstill = gyro.take_standstill_bias().filter(|_| covers_sweep);
        let rate_rad_s = rate_and_tilt.map(|(rate_rad_s, _)| rate_rad_s);
        let term = last_end_ns
            .zip(rate_rad_s)
            .and_then(|(last_ns, rate_rad_s)| {
                let turn = gyro.turn_between(last_ns, end_ns)?;
                let speed = gyro.inertial_speed();
                Some(GyroTerm {
                    turn,
                    rate_rad_s,
                    standstill,
                    speed_change: speed.change(),
                    speed: speed.speed(),
                    stands: speed.stands(),
                })
            });
        Self {
            turn,
            span_ns: (begin_ns, end_ns),
            // What the gyro lacks at its end may be too little to matter for the estimate, but it
            // is other bits.
            reaches_end: gyro
                .newest_ns()
                .is_some_and(|newest_ns| newest_ns >= gyro.own_ns(end_ns)),
            covers_sweep,
            tilt: rate_and_tilt.map_or(Tilt::LEVEL, |(_, tilt)| tilt),
            rate_rad_s,
            bias_rad_s: gyro.bias_rad_s().z,
            bias_sigma_rad_s: gyro.yaw_bias_sigma_rad_s(),
            bias_change: BiasChange::default(),
            term,
        }
    }

    /// Of a gyro that is not used: as without an IMU.
    pub fn unused(self) -> Self {
        Self {
            span_ns: self.span_ns,
            bias_rad_s: self.bias_rad_s,
            bias_sigma_rad_s: self.bias_sigma_rad_s,
            ..Self::default()
        }
    }

    /// How the IMU was used, counted where it lacks something.
    pub fn count_imu_use(&self, counters: &mut Counters) -> ImuUse {
        let (begin_ns, end_ns) = self.span_ns;
        match self.turn {
            Some(_) if self.covers_sweep && self.reaches_end => ImuUse::Covered,
            Some(turn) if turn.uncovered_s < (end_ns - begin_ns) as f64 * 1e-9 => {
                if counters.scans_imu_late == 0 {
                    counters.imu_late_first_ns = end_ns;
                    counters.imu_late_short_ns = (turn.uncovered_s * 1e9) as i64;
                }
                counters.scans_imu_late += 1;
                ImuUse::Late
            }
            Some(_) => {
                counters.scans_without_imu += 1;
                ImuUse::None
            }
            None => ImuUse::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;
    use randt_messages::ImuSample;

    const STEP_NS: i64 = 4_000_000;

    /// A gyro that turns evenly, with samples up to a stamp.
    fn gyro(until_ns: i64) -> GyroIntegrator {
        let config = Config::default();
        let mut gyro = GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry);
        for stamp_ns in (0..=until_ns).step_by(STEP_NS as usize) {
            let mut sample = ImuSample::default();
            sample.header.stamp_ns = stamp_ns;
            sample.rate_rad_s = [0.0, 0.0, 0.5];
            sample.acceleration_m_s2 = [0.0, 0.0, 9.81];
            gyro.push(&sample);
        }
        gyro
    }

    fn during(until_ns: i64, last_end_ns: Option<i64>) -> (GyroMeasurement, ImuUse, Counters) {
        let mut sweep = randt_messages::PointsHead::default().sweep;
        (sweep.begin_ns, sweep.end_ns) = (200_000_000, 400_000_000);
        let measured =
            GyroMeasurement::during_sweep(Some(&mut gyro(until_ns)), &sweep, last_end_ns);
        let mut counters = Counters::default();
        let imu_use = measured.count_imu_use(&mut counters);
        (measured, imu_use, counters)
    }

    #[test]
    fn a_covered_sweep_has_rate_and_turn() {
        let (measured, imu_use, counters) = during(400_000_000, Some(200_000_000));
        assert_eq!((imu_use, counters), (ImuUse::Covered, Counters::default()));
        let term = measured.term.unwrap();
        assert!((term.turn.angle_rad - 0.1).abs() < 1e-3 && term.rate_rad_s > 0.49);
        // The first scan of a frame has no factor.
        assert_eq!(during(400_000_000, None).0.term, None);
    }

    #[test]
    fn what_the_imu_lacks_is_counted() {
        let (measured, imu_use, counters) = during(396_000_000, Some(200_000_000));
        assert_eq!((imu_use, measured.covers_sweep), (ImuUse::Late, true));
        assert_eq!(
            (counters.scans_imu_late, counters.imu_late_short_ns),
            (1, 4_000_000)
        );
        let (measured, imu_use, _) = during(300_000_000, Some(200_000_000));
        assert_eq!((imu_use, measured.rate_rad_s), (ImuUse::Late, None));
        let (_, imu_use, counters) = during(100_000_000, Some(200_000_000));
        assert_eq!((imu_use, counters.scans_without_imu), (ImuUse::None, 1));
    }
}

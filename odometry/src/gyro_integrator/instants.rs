//! What the gyro measured at instants and between them. Its stamps may be late: an instant is read
//! by what the gyro would have stamped it with.

use super::{GyroIntegrator, GyroState, HOLE_NS, LATE_MAX_NS, Turn};
use crate::tilt::Tilt;

impl GyroIntegrator {
    /// An instant as the gyro stamps it.
    pub fn own_ns(&self, stamp_ns: i64) -> i64 {
        stamp_ns.saturating_add(self.late_ns)
    }

    /// How late its stamps are, as they were found to be, ns.
    pub fn late_ns(&self) -> i64 {
        self.late_ns
    }

    /// Whether its stamps may be later than they are read so far by this much.
    pub fn can_be_later(&self, by_ns: i64) -> bool {
        self.late_ns.saturating_add(by_ns).abs() <= LATE_MAX_NS
    }

    /// Its stamps are later than they were read so far by this much.
    pub fn add_late(&mut self, by_ns: i64) {
        self.late_ns = self.late_ns.saturating_add(by_ns);
        // The speed was carried by what belongs to other instants.
        self.inertial_speed.restart();
    }

    /// Forgets what is before an instant and not needed any more.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        let stamp_ns = self.own_ns(stamp_ns);
        let after = self.states.partition_point(|m| m.stamp_ns <= stamp_ns);
        // The last state before it stays: the instant is between it and the next one.
        self.states.drain(..after.saturating_sub(1));
    }

    /// Integrated heading at an instant, straight between samples, at the last rate beyond them.
    pub fn heading_rad(&self, stamp_ns: i64) -> Option<f64> {
        self.at(self.own_ns(stamp_ns), |state| {
            (state.heading_rad, state.rate_rad_s)
        })
    }

    /// What is integrated, at one of its own stamps; `integral_and_rate` gives it with its
    /// derivative.
    fn at(
        &self,
        stamp_ns: i64,
        integral_and_rate: impl Fn(&GyroState) -> (f64, f64),
    ) -> Option<f64> {
        let after = self.states.partition_point(|m| m.stamp_ns < stamp_ns);
        let seconds = |from: i64| (stamp_ns - from) as f64 * 1e-9;
        match (
            after.checked_sub(1).and_then(|i| self.states.get(i)),
            self.states.get(after),
        ) {
            (Some(a), Some(b)) => {
                let fraction = (stamp_ns - a.stamp_ns) as f64 / (b.stamp_ns - a.stamp_ns) as f64;
                let [(a, _), (b, _)] = [a, b].map(integral_and_rate);
                Some(a + (b - a) * fraction)
            }
            (Some(edge), None) | (None, Some(edge)) => {
                let (integral, rate) = integral_and_rate(edge);
                Some(integral + rate * seconds(edge.stamp_ns))
            }
            (None, None) => None,
        }
    }

    /// How the heading turned between two instants.
    pub fn turn_between(&self, from_ns: i64, to_ns: i64) -> Option<Turn> {
        let angle_rad = self.heading_rad(to_ns)? - self.heading_rad(from_ns)?;
        let [from_ns, to_ns] = [from_ns, to_ns].map(|stamp_ns| self.own_ns(stamp_ns));
        let (first, last) = (self.states.front()?.stamp_ns, self.states.back()?.stamp_ns);
        let beyond = (to_ns - last.max(from_ns)).max(0) + (first.min(to_ns) - from_ns).max(0);
        let mut holes = 0;
        let begin = self.states.partition_point(|m| m.stamp_ns < from_ns).max(1);
        for (a, b) in self
            .states
            .iter()
            .skip(begin - 1)
            .zip(self.states.iter().skip(begin))
        {
            if a.stamp_ns >= to_ns {
                break;
            }
            if b.stamp_ns - a.stamp_ns > HOLE_NS {
                holes += b.stamp_ns.min(to_ns) - a.stamp_ns.max(from_ns);
            }
        }
        Some(Turn {
            angle_rad,
            uncovered_s: (beyond + holes) as f64 * 1e-9,
        })
    }

    /// Yaw rate with its bias and tilt at the newest sample at or before an instant.
    pub fn rate_and_tilt(&self, stamp_ns: i64) -> Option<(f64, Tilt)> {
        let stamp_ns = self.own_ns(stamp_ns);
        let after = self.states.partition_point(|m| m.stamp_ns <= stamp_ns);
        self.states
            .get(after.saturating_sub(1))
            .map(|m| (m.rate_rad_s, m.tilt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;
    use randt_messages::ImuSample;

    #[test]
    fn a_gyro_that_is_late_is_read_later() {
        let config = Config::default();
        let mut gyro = GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry);
        // It turns for the second second, which it stamps 0.1 s too late.
        for number in 0..800 {
            let stamp_ns = i64::from(number) * 4_000_000;
            let mut sample = ImuSample::default();
            sample.header.stamp_ns = stamp_ns;
            let turns = (1_100_000_000..2_100_000_000).contains(&stamp_ns);
            sample.rate_rad_s = [0.0, 0.0, if turns { 0.5 } else { 0.0 }];
            sample.acceleration_m_s2 = [0.0, 0.0, 9.81];
            gyro.push(&sample);
        }
        let turned_rad = |gyro: &GyroIntegrator| {
            let turn = gyro.turn_between(1_000_000_000, 1_500_000_000).unwrap();
            assert_eq!(turn.uncovered_s, 0.0);
            turn.angle_rad
        };
        assert!((turned_rad(&gyro) - 0.2).abs() < 0.002);
        gyro.add_late(100_000_000);
        assert!((turned_rad(&gyro) - 0.25).abs() < 0.002);
        assert!(gyro.can_be_later(900_000_000) && !gyro.can_be_later(900_000_001));
        // Its last samples are those of 0.1 s before.
        let newest_ns = gyro.newest_ns().unwrap();
        let turn = gyro.turn_between(newest_ns - 200_000_000, newest_ns);
        assert!((turn.unwrap().uncovered_s - 0.1).abs() < 1e-9);
    }
}

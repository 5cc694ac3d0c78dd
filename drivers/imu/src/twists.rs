//! The robot's velocity by lines: readings become messages.

use crate::line::{LineSource, TwistReading};
use crate::reading_source::ReadingSource;
use randt_config::ImuDriver;
use randt_device::{Count, DeviceClock};
use randt_messages::Twist;
use std::os::fd::BorrowedFd;

/// Without a velocity for this time a wire of its own is silent, ns: odometry waits no longer for
/// one either.
const SILENCE_NS: i64 = 2_000_000_000;
/// No robot's wheels measure more: m/s, and rad/s.
const VELOCITY_MAX: f64 = 100.0;

/// Velocities that come by the IMU's wire, or by one of their own: then only by that.
#[derive(Debug)]
pub(crate) struct Twists {
    wire: Option<LineSource>,
    clock: DeviceClock,
    stamp_ns: i64,
    came: Vec<Twist>,
    /// When its driver began, or the last one came, ns.
    last_ns: Option<i64>,
    count: u64,
    unknown: u64,
    /// Why nothing comes by the wire, or an empty text.
    complaint: String,
}

impl Twists {
    pub fn new(config: &ImuDriver) -> Self {
        Self {
            wire: LineSource::of_twists(config),
            clock: DeviceClock::default(),
            stamp_ns: 0,
            came: Vec::new(),
            last_ns: None,
            count: 0,
            unknown: 0,
            complaint: String::new(),
        }
    }

    /// Takes what came by the IMU's wire and by its own.
    pub fn poll(&mut self, of_imu: &mut dyn ReadingSource, clock: &dyn Fn() -> i64) {
        let Some(mut wire) = self.wire.take() else {
            return of_imu.drain_twists(&mut |reading| self.push(&reading));
        };
        of_imu.drain_twists(&mut |_| {});
        // Samples of an IMU have their own wire.
        wire.poll(clock, &mut Vec::new());
        wire.drain_twists(&mut |reading| self.push(&reading));
        let now_ns = clock();
        let silent_ns = now_ns.saturating_sub(*self.last_ns.get_or_insert(now_ns));
        self.complaint = if !wire.fault().is_empty() {
            format!("robot/twist: {}", wire.fault())
        } else if silent_ns > SILENCE_NS {
            format!("robot/twist: {}", wire.silence())
        } else {
            match wire.complaint() {
                "" => String::new(),
                complaint => format!("robot/twist: {complaint}"),
            }
        };
        self.wire = Some(wire);
    }

    fn push(&mut self, reading: &TwistReading) {
        let line = &reading.line;
        let is_known = |value: &f64| value.abs() <= VELOCITY_MAX;
        let has_sigma = line
            .sigma
            .iter()
            .all(|sigma| (0.0..=VELOCITY_MAX).contains(sigma));
        if !line.velocity.iter().all(is_known) || !has_sigma {
            self.unknown += 1;
            return;
        }
        let measured_ns = match line.stamp_ns {
            Some(device_ns) => self.clock.host_ns(device_ns, reading.arrival_ns),
            None => reading.arrival_ns,
        };
        self.stamp_ns = measured_ns.max(self.stamp_ns.saturating_add(1));
        let mut twist = Twist {
            arrival_ns: reading.arrival_ns,
            velocity: line.velocity,
            ..Twist::default()
        };
        let [forward, left, yaw] = line.sigma;
        let diagonal = twist.covariance.iter_mut().step_by(4);
        for (variance, sigma) in diagonal.zip([forward, left, yaw]) {
            *variance = sigma * sigma;
        }
        twist.header.stamp_ns = self.stamp_ns;
        self.came.push(twist);
        self.last_ns = Some(reading.arrival_ns);
        self.count += 1;
    }

    /// Those that came since the last time.
    pub fn drain(&mut self) -> std::vec::Drain<'_, Twist> {
        self.came.drain(..)
    }

    /// What to sleep on, beside the IMU's.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.wire.as_ref()?.descriptor()
    }

    /// When to poll although nothing came.
    pub fn due_ns(&self) -> Option<i64> {
        let wire = self.wire.as_ref()?;
        let silent_ns = match self.complaint.as_str() {
            "" => self
                .last_ns
                .map(|last_ns| last_ns.saturating_add(SILENCE_NS + 1)),
            // It is in words already.
            _ => None,
        };
        wire.due_ns().into_iter().chain(silent_ns).min()
    }

    /// What is wrong with the wire, or an empty text.
    pub fn complaint(&self) -> &str {
        &self.complaint
    }

    /// What was counted; nothing where none ever came and none is expected.
    pub fn counts(&self) -> Vec<Count> {
        if self.wire.is_none() && self.count + self.unknown == 0 {
            return Vec::new();
        }
        let mut counts = vec![
            Count::event("twists", self.count),
            Count::loss("twists_unknown", self.unknown),
        ];
        if let Some(wire) = &self.wire {
            counts.push(Count::loss("twists_lost", wire.twists_lost()));
            // Its own names, lest they be those of the IMU's wire.
            counts.extend(wire.counts().iter().filter_map(|count| {
                let name = match count.name {
                    "lines_malformed" => "twist_lines_malformed",
                    "checksum_errors" => "twist_checksum_errors",
                    "lines_out_of_order" => "twist_lines_out_of_order",
                    "datagrams_of_another_sender" => "twist_datagrams_of_another_sender",
                    _ => return None,
                };
                Some(Count { name, ..*count })
            }));
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::TwistLine;

    fn reading(stamp_ns: Option<i64>, arrival_ns: i64, velocity: [f64; 3]) -> TwistReading {
        let line = TwistLine {
            stamp_ns,
            velocity,
            sigma: [0.1, 0.0, 0.2],
            ..TwistLine::default()
        };
        TwistReading { line, arrival_ns }
    }

    #[test]
    fn a_reading_is_a_message_in_the_hosts_time() {
        let mut twists = Twists::new(&ImuDriver::default());
        for number in 0..3 {
            let stamp_ns = Some(number * 20_000_000);
            // The second one comes 5 ms late.
            let arrival_ns =
                7_000_000_000 + number * 20_000_000 + [0, 5_000_000, 0][number as usize];
            twists.push(&reading(stamp_ns, arrival_ns, [0.8, 0.0, -0.1]));
        }
        let came: Vec<Twist> = twists.drain().collect();
        let stamps: Vec<i64> = came.iter().map(|twist| twist.header.stamp_ns).collect();
        assert_eq!(stamps, [7_000_000_000, 7_020_000_000, 7_040_000_000]);
        assert_eq!(came[1].velocity, [0.8, 0.0, -0.1]);
        let variances = [0.010_000_000_000_000_002, 0.0, 0.040_000_000_000_000_01];
        assert_eq!([0, 4, 8].map(|index| came[1].covariance[index]), variances);
    }

    #[test]
    fn what_no_wheels_measure_is_left_out_and_stamps_rise() {
        let mut twists = Twists::new(&ImuDriver::default());
        twists.push(&reading(None, 50, [0.1, 0.0, 0.0]));
        twists.push(&reading(None, 50, [0.2, 0.0, 0.0]));
        twists.push(&reading(None, 60, [101.0, 0.0, 0.0]));
        twists.push(&reading(None, 60, [f64::NAN, 0.0, 0.0]));
        let stamps: Vec<i64> = twists.drain().map(|twist| twist.header.stamp_ns).collect();
        assert_eq!(stamps, [50, 51]);
        let counts = twists.counts();
        let values: Vec<u64> = counts.iter().map(|count| count.value).collect();
        assert_eq!(values, [2, 2]);
    }
}

//! IMU samples that wait for the scan they belong to.
//!
//! Scans and samples come in two queues of their own, and how these interleave is arbitrary. So
//! samples are not used as they come: each scan takes from the queue up to the first sample at or
//! after its sweep's end, and no more; and none that was published when the wait for it was over.
//! What a scan sees is then a function of the two sequences alone, live or from a log.

use crate::gyro_integrator::GyroIntegrator;
use crate::stamps::{STAMPS_NS, is_set_back};
use randt_messages::ImuSample;
use randt_persist::{Error, Persist, Reader, Writer};
use std::collections::VecDeque;

/// Samples that may wait: 32 s at 250 Hz, 8 s at 1 kHz. A radar that was held up sends its sweep
/// at most that late. With samples that had to make room the result would depend on which stream
/// was faster.
const ROOM: usize = 8192;
/// No gyro measures more, rad/s.
const RATE_MAX_RAD_S: f64 = 100.0;
/// No accelerometer on a robot measures more, m/s^2 (200 g).
const ACCELERATION_MAX_M_S2: f64 = 2000.0;

/// The samples that no scan has asked for yet, in the order in which they came.
#[derive(Debug)]
pub struct ImuQueue {
    samples: VecDeque<ImuSample>,
}

impl ImuQueue {
    /// Empty; it never grows.
    pub fn new() -> Self {
        Self {
            samples: VecDeque::with_capacity(ROOM),
        }
    }

    /// Adds a sample; gives the oldest back where there is no room for both: no scan has come for
    /// a long time.
    pub fn push(&mut self, sample: &ImuSample) -> Option<ImuSample> {
        let oldest = (self.samples.len() >= ROOM)
            .then(|| self.samples.pop_front())
            .flatten();
        self.samples.push_back(*sample);
        oldest
    }

    /// The oldest sample.
    pub fn pop(&mut self) -> Option<ImuSample> {
        self.samples.pop_front()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// How many samples a sweep that ends at `end_ns` takes, after those that `gyro` has; `None`
    /// where the one that ends the count has not come yet. One that was published after
    /// `deadline_ns` came in vain, and so did all after it.
    ///
    /// Where the clock was set back, and for the gyro not yet (`is_old_time`), samples of the old
    /// time do not cover the sweep, whatever their stamps. A sweep of the old time in turn takes
    /// no samples of the new one, unless they are all that is left: then only the samples' clock
    /// was set back.
    pub fn covering(
        &self,
        end_ns: i64,
        deadline_ns: i64,
        mut is_old_time: bool,
        gyro: &GyroIntegrator,
    ) -> Option<usize> {
        let mut newest_ns = gyro.newest_ns();
        if !is_old_time && newest_ns.is_some_and(|t| t >= end_ns) {
            return Some(0);
        }
        for (i, sample) in self.samples.iter().enumerate() {
            if sample.header.published_ns > deadline_ns {
                return Some(i);
            }
            let stamp_ns = sample.header.stamp_ns;
            match newest_ns {
                Some(newest_ns) if is_set_back(stamp_ns, newest_ns) => {
                    if !is_old_time && i > 0 {
                        return Some(i);
                    }
                    is_old_time = false;
                }
                // Out of order: the gyro integrator will leave it out.
                Some(newest_ns) if stamp_ns <= newest_ns => continue,
                _ => {}
            }
            if !is_old_time && stamp_ns >= end_ns {
                return Some(i + 1);
            }
            newest_ns = Some(stamp_ns);
        }
        None
    }
}

impl Persist for ImuQueue {
    fn save(&self, out: &mut Writer<'_>) {
        self.samples.len().save(out);
        self.samples.iter().for_each(|sample| out.plain(sample));
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.samples.clear();
        let mut count = 0_usize;
        count.restore(from)?;
        for _ in 0..count {
            let sample = from.plain()?;
            if !is_measurement(&sample) || self.push(&sample).is_some() {
                return Err(Error::Unsound("IMU samples"));
            }
        }
        Ok(())
    }
}

/// Whether a sample can be a measurement: a possible stamp, and values that a sensor can have.
pub fn is_measurement(sample: &ImuSample) -> bool {
    // NaN compares false.
    STAMPS_NS.contains(&sample.header.stamp_ns)
        && sample.rate_rad_s.iter().all(|v| v.abs() <= RATE_MAX_RAD_S)
        && sample
            .acceleration_m_s2
            .iter()
            .all(|v| v.abs() <= ACCELERATION_MAX_M_S2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;

    const STEP_NS: i64 = 4_000_000;

    fn sample(number: i64) -> ImuSample {
        let mut sample = ImuSample::default();
        sample.header.stamp_ns = number * STEP_NS;
        sample.header.published_ns = number * STEP_NS + 1;
        sample.acceleration_m_s2 = [0.0, 0.0, 9.81];
        sample
    }

    fn gyro() -> GyroIntegrator {
        let config = Config::default();
        GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry)
    }

    #[test]
    fn a_sweep_takes_the_samples_up_to_the_first_at_or_after_its_end() {
        let mut queue = ImuQueue::new();
        (1..=5).for_each(|number| assert!(queue.push(&sample(number)).is_none()));
        let covering = |end_ns, deadline_ns| queue.covering(end_ns, deadline_ns, false, &gyro());
        assert_eq!(covering(3 * STEP_NS, i64::MAX), Some(3));
        assert_eq!(covering(3 * STEP_NS + 1, i64::MAX), Some(4));
        assert_eq!(covering(6 * STEP_NS, i64::MAX), None);
        // The third one was published too late.
        assert_eq!(covering(5 * STEP_NS, 3 * STEP_NS), Some(2));
    }

    #[test]
    fn samples_of_before_a_clock_was_set_back_do_not_cover() {
        let mut queue = ImuQueue::new();
        let second = 1_000_000_000 / STEP_NS;
        let mut gyro = gyro();
        gyro.push(&sample(10 * second));
        queue.push(&sample(10 * second + 1));
        assert_eq!(queue.covering(STEP_NS, i64::MAX, true, &gyro), None);
        queue.push(&sample(1));
        assert_eq!(queue.covering(STEP_NS, i64::MAX, true, &gyro), Some(2));
    }

    #[test]
    fn what_waits_survives_its_process() {
        let mut queue = ImuQueue::new();
        (1..=3).for_each(|number| assert!(queue.push(&sample(number)).is_none()));
        let mut bytes = [0; 1024];
        queue.save(&mut Writer::new(&mut bytes));
        let mut restored = ImuQueue::new();
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.samples, queue.samples);
    }
}

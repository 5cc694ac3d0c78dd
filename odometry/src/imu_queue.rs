//! IMU samples that wait for the scan they belong to.
//!
//! Scans and samples come in two queues of their own, and how these interleave is nobody's doing. So samples are not
//! used as they come: each scan takes from the queue up to the first sample at or after its sweep's end, and no more;
//! and none that was published when the wait for it was over. What a scan sees is then a function of the two sequences
//! alone, whoever reads them, live or from a log.

use crate::heading::{Heading, STAMPS_NS, is_set_back};
use randt_messages::ImuSample;
use randt_persist::{Error, Persist, Reader, Writer};
use std::collections::VecDeque;

/// Samples that may wait: 32 s at 250 Hz, 8 s at 1 kHz. A radar that was held up sends so late a sweep and no later; one
/// whose samples had to make room would see what depends on who was faster.
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

    /// Adds a sample; gives the oldest back where there is no room for both: no scan has come for long.
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

    /// How many samples a sweep that ends at `end_ns` takes, after those that `heading` has; `None` where the one that
    /// ends the count has not come yet. One that was published after `deadline_ns` came in vain, and so did all after it.
    ///
    /// Where the clock was set back, and for the heading not yet (`is_old_time`), samples of the old time do not cover
    /// the sweep, whatever their stamps. A sweep of the old time in turn takes no samples of the new, unless they are
    /// all that is left: then it was the samples' clock alone.
    pub fn covering(
        &self,
        end_ns: i64,
        deadline_ns: i64,
        mut is_old_time: bool,
        heading: &Heading,
    ) -> Option<usize> {
        let mut newest_ns = heading.newest_ns();
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
                // Out of order: the heading will leave it out.
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

/// Whether a reading can be one.
pub fn is_measurement(sample: &ImuSample) -> bool {
    // NaN compares false.
    STAMPS_NS.contains(&sample.header.stamp_ns)
        && sample.rate_rad_s.iter().all(|v| v.abs() <= RATE_MAX_RAD_S)
        && sample
            .acceleration_m_s2
            .iter()
            .all(|v| v.abs() <= ACCELERATION_MAX_M_S2)
}

//! The order in which a process takes what comes from two topics: samples as they come, one scan at a time.

use super::Past;
use crate::{Odometry, Source};
use randt_messages::{ImuSample, ImuSampleTopic, MessageRef, RadarPoints};
use randt_persist::Error as PersistError;
use randt_stage::{Clock, Subscriber};
use std::time::{Duration, Instant};

/// What was published before a scan's deadline is here so long after it at the latest: it takes microseconds, but a
/// publisher may be interrupted between stamp and sending.
const DELIVERY: Duration = Duration::from_millis(20);
/// Samples are taken so often where no scan comes: their buffer holds 8 s at 250 Hz, 2 s at 1 kHz.
const DRAIN: Duration = Duration::from_secs(1);
/// A process that has just started waits longer for its first samples: their publisher has to hand over its history.
const FIRST_SAMPLE_WAIT: Duration = Duration::from_secs(1);

/// Odometry with its past and its inputs.
pub struct Feed {
    /// The estimate.
    pub odometry: Odometry,
    /// What outlives it.
    pub past: Past,
    samples: Subscriber<ImuSampleTopic>,
    points: Subscriber<RadarPoints>,
    clock: Clock,
    /// Until when the scan that waits is waited with.
    deadline: Option<Instant>,
    /// When waiting for the very first sample ends.
    patience: Option<Instant>,
    /// Scans that were never seen between two that were.
    pub scans_missed: u64,
}

impl Feed {
    /// Ready; what an earlier process has done is skipped.
    pub fn new(
        odometry: Odometry,
        past: Past,
        mut samples: Subscriber<ImuSampleTopic>,
        points: Subscriber<RadarPoints>,
        clock: Clock,
    ) -> Self {
        if let Some(last) = odometry.last_imu() {
            samples.continue_after(last.epoch, last.sequence);
        }
        let mut feed = Self {
            odometry,
            past,
            samples,
            points,
            clock,
            deadline: None,
            patience: Some(Instant::now() + FIRST_SAMPLE_WAIT),
            scans_missed: 0,
        };
        feed.deadline = feed.deadline();
        feed
    }

    /// When the wait of the scan that waits is over by this process's clock.
    fn deadline(&self) -> Option<Instant> {
        let left_ns = self
            .odometry
            .deadline_ns()?
            .saturating_sub(self.clock.now_ns());
        // A scan of a publisher that says nothing of its time cannot be waited with for ever.
        let left = Duration::from_nanos(left_ns.max(0).unsigned_abs()).min(FIRST_SAMPLE_WAIT);
        let now = Instant::now();
        Some((now + left + DELIVERY).max(self.patience.unwrap_or(now)))
    }

    /// Takes what is there, until something comes out of it: that is kept, lies in the outbox, and is to be published
    /// before this is called again. `false` where nothing more is there, or has to be waited for.
    ///
    /// Not more at once: what is sent again after a restart is bounded.
    pub fn take(&mut self) -> Result<bool, Box<dyn std::error::Error>> {
        loop {
            if self.take_samples()? {
                return Ok(true);
            }
            if self.odometry.waiting_for_ns().is_some() {
                if self
                    .deadline
                    .is_none_or(|deadline| Instant::now() < deadline)
                {
                    return Ok(false);
                }
                // The samples may have come while this process was not running.
                if self.take_samples()? {
                    return Ok(true);
                }
                self.odometry.proceed(&mut self.past.sink());
                if self.keep()? {
                    return Ok(true);
                }
                continue;
            }
            self.deadline = None;
            let Some(scan) = self.points.receive()? else {
                return Ok(false);
            };
            let scan = scan.message();
            if self.is_new(scan) {
                self.odometry.push_points(scan, &mut self.past.sink());
                self.deadline = self.deadline();
                if self.keep()? {
                    return Ok(true);
                }
            }
        }
    }

    /// Takes samples until something comes out, or none is left.
    fn take_samples(&mut self) -> Result<bool, Box<dyn std::error::Error>> {
        while let Some(sample) = self.samples.receive()? {
            self.patience = None;
            let sample: &ImuSample = sample.message().head;
            let source = Source {
                epoch: sample.header.epoch,
                sequence: sample.header.sequence,
            };
            if is_after(source, self.odometry.last_imu()) {
                self.odometry.push_imu(sample, &mut self.past.sink());
                if self.keep()? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether a scan was not taken before; those between that never came are counted.
    fn is_new(&mut self, scan: MessageRef<'_, RadarPoints>) -> bool {
        let source = Source {
            epoch: scan.head.scan_epoch,
            sequence: scan.head.scan_sequence,
        };
        let last = self.odometry.last_scan();
        if let Some(last) = last
            && last.epoch == source.epoch
            && source.sequence > last.sequence + 1
        {
            self.scans_missed += source.sequence - last.sequence - 1;
        }
        is_after(source, last)
    }

    /// Keeps the past where something came out; gives whether it did.
    fn keep(&mut self) -> Result<bool, PersistError> {
        if self.past.outbox().is_empty() {
            return Ok(false);
        }
        self.past.keep(&self.odometry)?;
        Ok(true)
    }

    /// How long to sleep at most: where a scan waits for its samples, until that is over; else samples are to be taken
    /// before their buffer runs over, also while no scan comes.
    pub fn pause(&self) -> Duration {
        match (self.odometry.waiting_for_ns(), self.deadline) {
            (Some(_), Some(deadline)) => deadline.saturating_duration_since(Instant::now()),
            _ => DRAIN,
        }
    }

    /// What to sleep on: scans, or while one waits for its samples those. 250 wakings a second cost a core 0.7 %.
    pub fn wakes(&self) -> &dyn randt_stage::Waitable {
        if self.odometry.waiting_for_ns().is_some() {
            &self.samples
        } else {
            &self.points
        }
    }
}

/// Whether a message was not taken before. Another epoch is another publisher: its numbers have nothing to do with those
/// before, nor has its epoch where the clock was taken anew.
fn is_after(source: Source, last: Option<Source>) -> bool {
    last.is_none_or(|last| source.epoch != last.epoch || source.sequence > last.sequence)
}

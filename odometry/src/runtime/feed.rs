//! The order in which a process takes its inputs from three topics: samples and twists as they
//! come, one scan at a time.

use super::CheckpointStore;
use crate::{MessageId, Odometry};
use randt_messages::{ImuSample, ImuSampleTopic, MapperGraph, MessageRef, RadarPoints, TwistTopic};
use randt_persist::Error as PersistError;
use randt_stage::{Clock, Error, Stage, Subscriber, WakeReason};
use std::time::{Duration, Instant};

/// What was published before a scan's deadline is here this long after it at the latest: it takes
/// microseconds, but a publisher may be interrupted between stamp and sending.
const DELIVERY: Duration = Duration::from_millis(20);
/// Samples are taken this often where no scan comes: their buffer holds 8 s at 250 Hz, 2 s at 1
/// kHz.
const DRAIN: Duration = Duration::from_secs(1);
/// A process that has just started waits longer for its first samples: their publisher has to hand
/// over its history.
const FIRST_SAMPLE_WAIT: Duration = Duration::from_secs(1);

/// IMU samples, twists, scans.
pub type Inputs = (
    Subscriber<ImuSampleTopic>,
    Subscriber<TwistTopic>,
    Subscriber<RadarPoints>,
);

/// Odometry with its checkpoints and its inputs.
pub struct Feed {
    /// The estimate.
    pub odometry: Odometry,
    /// What outlives it.
    pub store: CheckpointStore,
    samples: Subscriber<ImuSampleTopic>,
    twists: Subscriber<TwistTopic>,
    points: Subscriber<RadarPoints>,
    clock: Clock,
    /// When the wait of the scan that waits is over.
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
        store: CheckpointStore,
        (mut samples, mut twists, points): Inputs,
        clock: Clock,
    ) -> Self {
        if let Some(last) = odometry.last_imu() {
            samples.continue_after(last.epoch, last.sequence);
        }
        if let Some(last) = odometry.last_twist() {
            twists.continue_after(last.epoch, last.sequence);
        }
        let mut feed = Self {
            odometry,
            store,
            samples,
            twists,
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
        // Without a publish time the wait must still end.
        let left = Duration::from_nanos(left_ns.max(0).unsigned_abs()).min(FIRST_SAMPLE_WAIT);
        let now = Instant::now();
        Some((now + left + DELIVERY).max(self.patience.unwrap_or(now)))
    }

    /// Takes inputs until there is a result: it is saved, is in the outbox, and must be published
    /// before the next call. `false` where no input is left, or one has to be waited for.
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
                self.odometry.proceed(&mut self.store.sink());
                if self.save_results()? {
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
                self.odometry.push_points(scan, &mut self.store.sink());
                self.deadline = self.deadline();
                if self.save_results()? {
                    return Ok(true);
                }
            }
        }
    }

    /// Takes twists and samples until there is a result, or none is left.
    fn take_samples(&mut self) -> Result<bool, Box<dyn std::error::Error>> {
        while let Some(twist) = self.twists.receive()? {
            let twist = twist.message().head;
            if is_after(MessageId::from_twist(twist), self.odometry.last_twist()) {
                self.odometry.push_twist(twist, &mut self.store.sink());
                if self.save_results()? {
                    return Ok(true);
                }
            }
        }
        while let Some(sample) = self.samples.receive()? {
            self.patience = None;
            let sample: &ImuSample = sample.message().head;
            if is_after(MessageId::from_sample(sample), self.odometry.last_imu()) {
                self.odometry.push_imu(sample, &mut self.store.sink());
                if self.save_results()? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether a scan was not taken before; those in between that never came are counted.
    fn is_new(&mut self, scan: MessageRef<'_, RadarPoints>) -> bool {
        let id = MessageId::from_points(scan.head);
        let last = self.odometry.last_scan();
        if let Some(last) = last
            && last.epoch == id.epoch
            && id.sequence > last.sequence + 1
        {
            self.scans_missed += id.sequence - last.sequence - 1;
        }
        is_after(id, last)
    }

    /// Saves state and results where there are results; gives whether there are.
    fn save_results(&mut self) -> Result<bool, PersistError> {
        if self.store.outbox().is_empty() {
            return Ok(false);
        }
        self.store.save(&self.odometry)?;
        Ok(true)
    }

    /// How long to sleep at most: where a scan waits for its samples, until the wait is over; else
    /// samples have to be taken before their buffer overflows, also while no scan comes.
    fn pause(&self) -> Duration {
        match (self.odometry.waiting_for_ns(), self.deadline) {
            (Some(_), Some(deadline)) => deadline.saturating_duration_since(Instant::now()),
            _ => DRAIN,
        }
    }

    /// Sleeps until a scan or a word of the mapper comes, or samples and twists while a scan waits
    /// for them. Waking 250 times a second costs 0.7 % of a core.
    pub fn wait(
        &self,
        stage: &mut Stage,
        graph: &Subscriber<MapperGraph>,
    ) -> Result<WakeReason, Error> {
        let pause = Some(self.pause());
        if self.odometry.waiting_for_ns().is_some() {
            stage.wait(&[&self.samples, &self.twists, graph], pause)
        } else {
            stage.wait(&[&self.points, graph], pause)
        }
    }
}

/// Whether a message was not taken before. Another epoch is another publisher, whose numbers begin
/// anew; its epoch need not be larger, because the clock may have been set.
fn is_after(id: MessageId, last: Option<MessageId>) -> bool {
    last.is_none_or(|last| id.epoch != last.epoch || id.sequence > last.sequence)
}

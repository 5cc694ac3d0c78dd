//! The inputs: scans, IMU samples and twists wait for each other, so that the order in which they
//! are used does not depend on the order in which they come.

mod imu_queue;
mod twist_queue;

use crate::{
    Counters,
    gyro_integrator::GyroIntegrator,
    scan::{Scan, is_sweep},
    stamps::{STAMPS_NS, is_set_back},
};
use imu_queue::{ImuQueue, is_measurement};
use randt_config::Odometry as Config;
use randt_messages::{ImuSample, MessageRef, PointsHead, RadarPoints, Twist};
use randt_persist::{Error, Persist, Reader, Writer, persist};
use std::collections::VecDeque;
use twist_queue::TwistQueue;

/// Scans that may wait for the IMU; a wait of 0.1 s never holds more than one or two.
const PENDING_MAX: usize = 4;

/// A message by its publisher's start and its number: its epoch and its sequence. Later ones are
/// greater.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct MessageId {
    /// New at each start of the publisher.
    pub epoch: u64,
    /// Number in that epoch.
    pub sequence: u64,
}

persist!(MessageId { epoch, sequence });

impl MessageId {
    /// The scan that points were filtered from.
    pub fn from_points(head: &PointsHead) -> Self {
        Self {
            epoch: head.scan_epoch,
            sequence: head.scan_sequence,
        }
    }

    /// A twist.
    pub fn from_twist(twist: &Twist) -> Self {
        Self {
            epoch: twist.header.epoch,
            sequence: twist.header.sequence,
        }
    }

    /// An IMU sample.
    pub fn from_sample(sample: &ImuSample) -> Self {
        Self {
            epoch: sample.header.epoch,
            sequence: sample.header.sequence,
        }
    }
}

/// A scan whose turn has come.
#[derive(Debug)]
pub struct SynchronizedScan {
    /// The scan; [`ScanImuSynchronizer::recycle`] takes its memory back.
    pub scan: Scan,
    /// How many of the waiting samples are used for it.
    pub samples: usize,
    /// How many of the waiting twists.
    pub twists: usize,
}

/// Holds scans until the IMU covers their sweeps, and twists where there are some, or until the
/// bounded wait for that is over.
#[derive(Debug)]
pub struct ScanImuSynchronizer {
    imu_wait_ns: i64,
    radar_late_ns: i64,
    /// Samples that the gyro integrator has not seen yet.
    imu: ImuQueue,
    /// Twists that no scan has taken yet.
    twists: TwistQueue,
    /// Scans that wait for the IMU or twists, and messages to reuse.
    pending: VecDeque<Scan>,
    spare: Vec<Scan>,
    /// Deadline of the last scan that was computed because its wait was over.
    ended_wait_ns: Option<i64>,
    /// End of the last sweep that was used.
    last_end_ns: Option<i64>,
    /// Whether the clock was set back for the scans and not yet for the IMU.
    imu_is_old: bool,
    last_scan: Option<MessageId>,
    last_imu: Option<MessageId>,
    last_twist: Option<MessageId>,
}

impl ScanImuSynchronizer {
    /// Nothing waits.
    pub fn new(config: &Config) -> Self {
        Self {
            imu_wait_ns: (config.imu_wait_max_s * 1e9) as i64,
            radar_late_ns: (config.radar_late_s * 1e9) as i64,
            imu: ImuQueue::new(),
            twists: TwistQueue::new(),
            pending: VecDeque::with_capacity(PENDING_MAX),
            spare: (0..PENDING_MAX).map(|_| Scan::with_room()).collect(),
            ended_wait_ns: None,
            last_end_ns: None,
            imu_is_old: false,
            last_scan: None,
            last_imu: None,
            last_twist: None,
        }
    }

    /// Takes an IMU sample. Gives the oldest one where there is no room for both: it is to be
    /// integrated at once.
    pub fn push_imu(&mut self, sample: &ImuSample, counters: &mut Counters) -> Option<ImuSample> {
        self.last_imu = Some(MessageId::from_sample(sample));
        if !is_measurement(sample) {
            counters.imu_rejected += 1;
            return None;
        }
        // Samples come in the order of publishing: the first one shows whether another was on its
        // way in time.
        let published_ns = sample.header.published_ns;
        let ended_wait_ns = self.ended_wait_ns.take();
        if ended_wait_ns.is_some_and(|end_ns| (1..=end_ns).contains(&published_ns)) {
            counters.scans_imu_overtaken += 1;
        }
        self.imu.push(sample)
    }

    /// Takes a twist.
    pub fn push_twist(&mut self, twist: &Twist, counters: &mut Counters) {
        self.last_twist = Some(MessageId::from_twist(twist));
        if !twist_queue::is_measurement(twist) || !self.twists.push(twist) {
            counters.twists_rejected += 1;
        }
    }

    /// Takes a filtered scan; gives the end of its sweep, ns, or `None` where it is rejected.
    pub fn push_scan(
        &mut self,
        points: MessageRef<'_, RadarPoints>,
        counters: &mut Counters,
    ) -> Option<i64> {
        self.last_scan = Some(MessageId::from_points(points.head));
        if !is_sweep(points) {
            counters.scans_rejected += 1;
            return None;
        }
        let mut scan = self.spare.pop().unwrap_or_default();
        scan.copy_from(points);
        if self.radar_late_ns != 0 {
            scan.shift_earlier(self.radar_late_ns);
            if !is_sweep(scan.as_ref()) {
                counters.scans_rejected += 1;
                self.spare.push(scan);
                return None;
            }
        }
        let end_ns = scan.head.sweep.end_ns;
        self.pending.push_back(scan);
        Some(end_ns)
    }

    /// The next scan whose sweep the IMU covers, or for which nothing more can come. `gyro` is
    /// `None` where scans do not wait for an IMU.
    pub fn take_covered(&mut self, gyro: Option<&GyroIntegrator>) -> Option<SynchronizedScan> {
        let samples = self.samples_covering(gyro)?;
        let twists = self.twists_covering()?;
        self.take_first(samples, twists)
    }

    /// How many samples the first scan that waits takes; `None` where they do not cover it yet.
    fn samples_covering(&self, gyro: Option<&GyroIntegrator>) -> Option<usize> {
        let (end_ns, deadline_ns) = (self.waiting_for_ns()?, self.deadline_ns()?);
        let Some(gyro) = gyro else {
            return Some(0);
        };
        let is_old = self.is_imu_old(end_ns, Some(gyro));
        (self.imu).covering(gyro.own_ns(end_ns), deadline_ns, is_old, gyro)
    }

    /// The same of twists.
    fn twists_covering(&self) -> Option<usize> {
        (self.twists).covering(self.waiting_for_ns()?, self.deadline_ns()?)
    }

    /// The first scan that waits, with all samples and twists that are there of those that it
    /// lacks: its wait is over.
    pub fn take_uncovered(&mut self, gyro: Option<&GyroIntegrator>) -> Option<SynchronizedScan> {
        let samples = self.samples_covering(gyro).unwrap_or_else(|| {
            self.ended_wait_ns = self.deadline_ns().filter(|end_ns| *end_ns != i64::MAX);
            self.imu.len()
        });
        let twists = (self.twists_covering()).unwrap_or_else(|| self.twists.len());
        self.take_first(samples, twists)
    }

    fn take_first(&mut self, samples: usize, twists: usize) -> Option<SynchronizedScan> {
        let scan = self.pending.pop_front()?;
        Some(SynchronizedScan {
            scan,
            samples,
            twists,
        })
    }

    /// Whether the wait of the first scan is over because a sweep came that ends at
    /// `newest_end_ns`, or because there is no room for more scans.
    pub fn is_wait_over(&self, newest_end_ns: i64) -> bool {
        self.waiting_for_ns().is_some_and(|end_ns| {
            // A stamp far back means that the clock was set: nothing more will come for the scan
            // before.
            newest_end_ns > end_ns.saturating_add(self.imu_wait_ns)
                || is_set_back(newest_end_ns, end_ns)
                || self.pending.len() >= PENDING_MAX
        })
    }

    /// Takes the memory of a scan back.
    pub fn recycle(&mut self, scan: Scan) {
        self.spare.push(scan);
    }

    /// The oldest sample that waits.
    pub fn pop_imu(&mut self) -> Option<ImuSample> {
        self.imu.pop()
    }

    /// The oldest twist that waits.
    pub fn pop_twist(&mut self) -> Option<Twist> {
        self.twists.pop()
    }

    /// How many samples wait.
    pub fn imu_len(&self) -> usize {
        self.imu.len()
    }

    /// A scan is used whose sweep ends at `end_ns`, and `gyro` has its samples.
    pub fn advance(&mut self, end_ns: i64, gyro: Option<&GyroIntegrator>) {
        self.imu_is_old = self.is_imu_old(end_ns, gyro);
        self.last_end_ns = Some(end_ns);
    }

    /// Whether the clock was set back for a scan that ends at `end_ns`, and not yet for the
    /// samples that the gyro has.
    fn is_imu_old(&self, end_ns: i64, gyro: Option<&GyroIntegrator>) -> bool {
        let newest_ns = gyro.and_then(GyroIntegrator::newest_ns);
        (self.imu_is_old || self.last_end_ns.is_some_and(|t| is_set_back(end_ns, t)))
            && newest_ns.is_some_and(|t| is_set_back(end_ns, t))
    }

    /// End of the last sweep that was used, ns.
    pub fn last_end_ns(&self) -> Option<i64> {
        self.last_end_ns
    }

    /// The last scan that was pushed.
    pub fn last_scan(&self) -> Option<MessageId> {
        self.last_scan
    }

    /// The last IMU sample that was pushed.
    pub fn last_imu(&self) -> Option<MessageId> {
        self.last_imu
    }

    /// The last twist that was pushed.
    pub fn last_twist(&self) -> Option<MessageId> {
        self.last_twist
    }

    /// End of the first sweep that waits for the IMU or twists, ns.
    pub fn waiting_for_ns(&self) -> Option<i64> {
        self.pending.front().map(|scan| scan.head.sweep.end_ns)
    }

    /// Until when samples must be published that the first scan that waits may use, ns; `i64::MAX`
    /// where the scan was never published.
    pub fn deadline_ns(&self) -> Option<i64> {
        Some(match self.pending.front()?.head.scan_published_ns {
            0 => i64::MAX,
            published_ns => published_ns.saturating_add(self.imu_wait_ns),
        })
    }
}

impl Persist for ScanImuSynchronizer {
    fn save(&self, out: &mut Writer<'_>) {
        // Named one by one, so that a new field is not forgotten.
        let Self {
            imu_wait_ns: _,
            radar_late_ns: _,
            imu,
            twists,
            pending,
            spare: _,
            ended_wait_ns,
            last_end_ns,
            imu_is_old,
            last_scan,
            last_imu,
            last_twist,
        } = self;
        imu.save(out);
        twists.save(out);
        pending.len().save(out);
        pending.iter().for_each(|scan| scan.save(out));
        ended_wait_ns.save(out);
        last_end_ns.save(out);
        imu_is_old.save(out);
        last_scan.save(out);
        last_imu.save(out);
        last_twist.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.imu.restore(from)?;
        self.twists.restore(from)?;
        let mut pending = 0_usize;
        pending.restore(from)?;
        if pending > PENDING_MAX {
            return Err(Error::Unsound("waiting scans"));
        }
        for _ in 0..pending {
            let mut scan = self.spare.pop().unwrap_or_default();
            scan.restore(from)?;
            self.pending.push_back(scan);
        }
        self.ended_wait_ns.restore(from)?;
        self.last_end_ns.restore(from)?;
        if self.last_end_ns.is_some_and(|t| !STAMPS_NS.contains(&t)) {
            return Err(Error::Unsound("stamp of the last scan"));
        }
        self.imu_is_old.restore(from)?;
        self.last_scan.restore(from)?;
        self.last_imu.restore(from)?;
        self.last_twist.restore(from)
    }
}

#[cfg(test)]
mod tests;

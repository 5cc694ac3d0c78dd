//! The inputs: scans and IMU samples wait for each other, so that the order in which they are used
//! does not depend on the order in which they come.

mod imu_queue;

use crate::{
    Counters,
    gyro_integrator::GyroIntegrator,
    scan::{Scan, is_sweep},
    stamps::{STAMPS_NS, is_set_back},
};
use imu_queue::{ImuQueue, is_measurement};
use randt_config::Odometry as Config;
use randt_messages::{ImuSample, MessageRef, PointsHead, RadarPoints};
use randt_persist::{Error, Persist, Reader, Writer, persist};
use std::collections::VecDeque;

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
}

/// Holds scans until the IMU covers their sweeps, or until the bounded wait for that is over.
#[derive(Debug)]
pub struct ScanImuSynchronizer {
    imu_wait_ns: i64,
    radar_late_ns: i64,
    /// Samples that the gyro integrator has not seen yet.
    imu: ImuQueue,
    /// Scans that wait for the IMU, and messages to reuse.
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
}

impl ScanImuSynchronizer {
    /// Nothing waits.
    pub fn new(config: &Config) -> Self {
        Self {
            imu_wait_ns: (config.imu_wait_max_s * 1e9) as i64,
            radar_late_ns: (config.radar_late_s * 1e9) as i64,
            imu: ImuQueue::new(),
            pending: VecDeque::with_capacity(PENDING_MAX),
            spare: (0..PENDING_MAX).map(|_| Scan::with_room()).collect(),
            ended_wait_ns: None,
            last_end_ns: None,
            imu_is_old: false,
            last_scan: None,
            last_imu: None,
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
        let (end_ns, deadline_ns) = (self.waiting_for_ns()?, self.deadline_ns()?);
        let samples = match gyro {
            Some(gyro) => {
                let is_old = self.is_imu_old(end_ns, Some(gyro));
                self.imu.covering(end_ns, deadline_ns, is_old, gyro)?
            }
            None => 0,
        };
        self.take_first(samples)
    }

    /// The first scan that waits, with all samples that are there: its wait is over.
    pub fn take_uncovered(&mut self) -> Option<SynchronizedScan> {
        self.ended_wait_ns = self.deadline_ns().filter(|end_ns| *end_ns != i64::MAX);
        self.take_first(self.imu.len())
    }

    fn take_first(&mut self, samples: usize) -> Option<SynchronizedScan> {
        let scan = self.pending.pop_front()?;
        Some(SynchronizedScan { scan, samples })
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

    /// End of the first sweep that waits for the IMU, ns.
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
            pending,
            spare: _,
            ended_wait_ns,
            last_end_ns,
            imu_is_old,
            last_scan,
            last_imu,
        } = self;
        imu.save(out);
        pending.len().save(out);
        pending.iter().for_each(|scan| scan.save(out));
        ended_wait_ns.save(out);
        last_end_ns.save(out);
        imu_is_old.save(out);
        last_scan.save(out);
        last_imu.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.imu.restore(from)?;
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
        self.last_imu.restore(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Message;

    const SWEEP_NS: i64 = 200_000_000;

    fn sweep(number: i64) -> Message<RadarPoints> {
        let mut scan = Message::<RadarPoints>::default();
        let head = &mut *scan.head;
        (head.scan_epoch, head.scan_sequence) = (7, number as u64);
        head.scan_published_ns = number * SWEEP_NS + 1000;
        (head.sweep.begin_ns, head.sweep.end_ns) = ((number - 1) * SWEEP_NS, number * SWEEP_NS);
        scan
    }

    fn sample(stamp_ns: i64) -> ImuSample {
        let mut sample = ImuSample::default();
        (sample.header.stamp_ns, sample.header.published_ns) = (stamp_ns, stamp_ns + 1);
        sample
    }

    /// One that scans do wait in, and the gyro's part.
    fn synchronizer() -> (ScanImuSynchronizer, GyroIntegrator, Counters) {
        let config = randt_config::Config::default();
        (
            ScanImuSynchronizer::new(&config.odometry),
            GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry),
            Counters::default(),
        )
    }

    #[test]
    fn a_scan_waits_until_a_sample_covers_it() {
        let (mut waiting, gyro, mut counters) = synchronizer();
        let end_ns = waiting.push_scan(sweep(3).as_ref(), &mut counters);
        assert_eq!(end_ns, Some(3 * SWEEP_NS));
        waiting.push_imu(&sample(2 * SWEEP_NS), &mut counters);
        assert!(waiting.take_covered(Some(&gyro)).is_none());
        waiting.push_imu(&sample(3 * SWEEP_NS), &mut counters);
        let taken = waiting.take_covered(Some(&gyro)).unwrap();
        assert_eq!((taken.scan.head.scan_sequence, taken.samples), (3, 2));
        assert_eq!(waiting.waiting_for_ns(), None);
        // Without an IMU nothing waits.
        waiting.push_scan(sweep(4).as_ref(), &mut counters);
        assert_eq!(waiting.take_covered(None).unwrap().samples, 0);
    }

    #[test]
    fn the_wait_ends_by_a_later_scan_or_for_want_of_room() {
        let (mut waiting, _, mut counters) = synchronizer();
        waiting.push_scan(sweep(3).as_ref(), &mut counters);
        assert!(!waiting.is_wait_over(3 * SWEEP_NS));
        assert!(waiting.is_wait_over(4 * SWEEP_NS));
        (1..PENDING_MAX).for_each(|_| {
            assert!(!waiting.is_wait_over(3 * SWEEP_NS));
            waiting.push_scan(sweep(3).as_ref(), &mut counters);
        });
        assert!(waiting.is_wait_over(3 * SWEEP_NS));
        let deadline_ns = waiting.deadline_ns().unwrap();
        assert_eq!(waiting.take_uncovered().unwrap().samples, 0);
        // A sample that was published in time overtook nothing; it was overtaken.
        waiting.push_imu(&sample(deadline_ns - 1), &mut counters);
        assert_eq!(counters.scans_imu_overtaken, 1);
    }

    #[test]
    fn a_sweep_without_possible_times_is_rejected() {
        let (mut waiting, _, mut counters) = synchronizer();
        let mut scan = sweep(3);
        scan.head.sweep.end_ns = -1;
        assert_eq!(waiting.push_scan(scan.as_ref(), &mut counters), None);
        assert_eq!(counters.scans_rejected, 1);
        let id = MessageId {
            epoch: 7,
            sequence: 3,
        };
        assert_eq!(waiting.last_scan(), Some(id));
    }

    #[test]
    fn what_waits_survives_its_process() {
        let (mut whole, gyro, mut counters) = synchronizer();
        whole.push_scan(sweep(3).as_ref(), &mut counters);
        whole.push_imu(&sample(2 * SWEEP_NS), &mut counters);
        whole.advance(2 * SWEEP_NS, Some(&gyro));
        let mut bytes = vec![0; 1 << 20];
        whole.save(&mut Writer::new(&mut bytes));
        let (mut restored, ..) = synchronizer();
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.last_end_ns(), Some(2 * SWEEP_NS));
        assert_eq!(restored.deadline_ns(), whole.deadline_ns());
        assert_eq!(
            (restored.imu_len(), restored.last_imu()),
            (1, whole.last_imu())
        );
        let scan = restored.take_uncovered().unwrap().scan;
        assert_eq!(scan.head.scan_sequence, 3);
    }
}

//! What comes in: checks, and the order in which scans and IMU samples are used whatever the order they come in.

use super::{Odometry, PENDING, Sink};
use crate::{
    heading::{Heading, is_set_back},
    imu_queue::is_measurement,
    scan,
};
use randt_messages::{ImuSample, MessageRef, RadarPoints};
use randt_persist::persist;

/// A message by its publisher's start and its number: what the source's epoch and sequence say. Later ones are greater.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Source {
    /// New at each start of the publisher.
    pub epoch: u64,
    /// Number in that epoch.
    pub sequence: u64,
}

persist!(Source { epoch, sequence });

impl Odometry {
    /// Takes an IMU sample; scans that waited for it are processed.
    pub fn push_imu(&mut self, sample: &ImuSample, sink: &mut impl Sink) {
        let Some(heading) = &mut self.heading else {
            return;
        };
        self.last_imu = Some(Source {
            epoch: sample.header.epoch,
            sequence: sample.header.sequence,
        });
        if !is_measurement(sample) {
            self.counters.imu_rejected += 1;
            return;
        }
        // Samples come in the order of publishing: the first one tells whether another was on its way in time.
        let published_ns = sample.header.published_ns;
        let ended_wait_ns = self.ended_wait_ns.take();
        if ended_wait_ns.is_some_and(|end_ns| (1..=end_ns).contains(&published_ns)) {
            self.counters.scans_imu_overtaken += 1;
        }
        if let Some(oldest) = self.imu.push(sample)
            && let Some(standstill) = heading.push(&oldest)
        {
            self.standstill = Some(standstill);
        }
        self.process_covered(sink);
    }

    /// Takes a filtered scan; it is processed as soon as the IMU covers its sweep. A later scan ends the wait of those
    /// whose sweep ended `imu_wait_max_s` before its own: in a file there is no other clock. A process, whose scans may
    /// run ahead of their samples, keeps the next scan back while [`Self::waiting_for_ns`] has one, and [proceeds]
    /// when its own clock says that nothing will come before [`Self::deadline_ns`].
    ///
    /// [proceeds]: Self::proceed
    pub fn push_points(&mut self, points: MessageRef<'_, RadarPoints>, sink: &mut impl Sink) {
        self.last_scan = Some(Source {
            epoch: points.head.scan_epoch,
            sequence: points.head.scan_sequence,
        });
        if !scan::is_sweep(points) {
            self.counters.scans_rejected += 1;
            return;
        }
        let mut message = self.spare.pop().unwrap_or_default();
        scan::copy(points, &mut message);
        if self.config.odometry.radar_late_s != 0.0 {
            let late_ns = (self.config.odometry.radar_late_s * 1e9) as i64;
            scan::earlier(&mut message, late_ns);
            if !scan::is_sweep(message.as_ref()) {
                self.counters.scans_rejected += 1;
                self.spare.push(message);
                return;
            }
        }
        let stamp_ns = message.head.sweep.end_ns;
        self.pending.push_back(message);
        self.process_covered(sink);
        let wait_ns = (self.config.odometry.imu_wait_max_s * 1e9) as i64;
        while let Some(end_ns) = self.waiting_for_ns() {
            // A stamp far back means that the clock was set: nothing more will come for the scan before.
            let waited = stamp_ns > end_ns.saturating_add(wait_ns) || is_set_back(stamp_ns, end_ns);
            if !waited && self.pending.len() < PENDING {
                return;
            }
            self.proceed(sink);
        }
    }

    /// The last scan that was pushed: a process that comes back pushes those after it.
    pub fn last_scan(&self) -> Option<Source> {
        self.last_scan
    }

    /// The last IMU sample that was pushed.
    pub fn last_imu(&self) -> Option<Source> {
        self.last_imu
    }

    /// The end of the sweep that waits for the IMU, the first where there are several.
    pub fn waiting_for_ns(&self) -> Option<i64> {
        self.pending.front().map(|scan| scan.head.sweep.end_ns)
    }

    /// Until when samples must be published that the first scan that waits may use, by the clock that publishes: the
    /// bounded wait as what the messages say of themselves, so that a log of them says it too. Without an end where the
    /// scan was never published.
    pub fn deadline_ns(&self) -> Option<i64> {
        let wait_ns = (self.config.odometry.imu_wait_max_s * 1e9) as i64;
        let published_ns = self.pending.front()?.head.scan_published_ns;
        Some(match published_ns {
            0 => i64::MAX,
            published_ns => published_ns.saturating_add(wait_ns),
        })
    }

    /// The wait of the first scan that waits is over: it is processed with the IMU samples that are there, and its
    /// state says so.
    pub fn proceed(&mut self, sink: &mut impl Sink) {
        self.ended_wait_ns = self.deadline_ns().filter(|end_ns| *end_ns != i64::MAX);
        self.process_first(self.imu.len(), sink);
        self.process_covered(sink);
    }

    /// Ends: processes what waits and hands the window's scans over.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        while self.waiting_for_ns().is_some() {
            self.proceed(sink);
        }
        // Nothing asks for the samples that are left, but they are counted.
        self.feed(self.imu.len());
        self.settle_all(sink);
    }

    /// Processes waiting scans as far as the IMU covers them.
    fn process_covered(&mut self, sink: &mut impl Sink) {
        while let (Some(end_ns), Some(deadline_ns)) = (self.waiting_for_ns(), self.deadline_ns()) {
            let samples = self.heading.as_ref().map_or(Some(0), |heading| {
                let is_old = self.imu_is_old(end_ns);
                self.imu.covering(end_ns, deadline_ns, is_old, heading)
            });
            match samples {
                Some(samples) => self.process_first(samples, sink),
                None => return,
            }
        }
    }

    fn process_first(&mut self, samples: usize, sink: &mut impl Sink) {
        if let Some(scan) = self.pending.pop_front() {
            self.step(&scan, samples, sink);
            self.spare.push(scan);
        }
    }

    /// Whether the clock was set back for a scan that ends at `end_ns`, and not yet for the samples that the heading has.
    pub(super) fn imu_is_old(&self, end_ns: i64) -> bool {
        let last_ns = self.frame.last_stamp_ns;
        let newest_ns = self.heading.as_ref().and_then(Heading::newest_ns);
        (self.frame.imu_is_old || last_ns.is_some_and(|t| is_set_back(end_ns, t)))
            && newest_ns.is_some_and(|t| is_set_back(end_ns, t))
    }

    /// Lets the heading see so many of the waiting samples.
    pub(super) fn feed(&mut self, samples: usize) {
        let Some(heading) = &mut self.heading else {
            return;
        };
        for _ in 0..samples {
            let Some(sample) = self.imu.pop() else {
                return;
            };
            if let Some(standstill) = heading.push(&sample) {
                self.standstill = Some(standstill);
            }
        }
    }
}

//! The stages composed in one thread: filter, then odometry. The same code as in the processes.

use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_messages::{Message, RadarPoints, Topic};
use randt_odometry::{Counters, Odometry, Sink};
use randt_readers::Event;
use std::time::Instant;

/// Filter and odometry, with what they cost.
#[derive(Debug)]
pub struct Pipeline {
    filter: ClusterFilter,
    points: Message<RadarPoints>,
    odometry: Odometry,
    /// What each scan cost.
    pub timing: Timing,
    /// Cost of the IMU samples since the last scan, ns.
    since_scan_ns: u64,
}

/// Time per scan and stage, ns.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Radar filter.
    pub filter_ns: Vec<u64>,
    /// Motion estimation, the samples of the gyro included.
    pub odometry_ns: Vec<u64>,
}

impl Pipeline {
    /// Ready for the first event.
    pub fn new(config: &Config, use_imu: bool) -> Self {
        let mut points = Message::<RadarPoints>::default();
        // Room for every scan from the start: nothing grows later.
        points.items.reserve(RadarPoints::MAX_ITEMS);
        Self {
            filter: ClusterFilter::new(&config.filter, &config.sensor),
            points,
            odometry: Odometry::new(config, use_imu),
            timing: Timing::default(),
            since_scan_ns: 0,
        }
    }

    /// Takes one event of a log; the truth is not looked at.
    pub fn push(&mut self, event: &Event, sink: &mut impl Sink) {
        let begin = Instant::now();
        match event {
            Event::Scan(scan) => {
                self.filter.process(scan.as_ref(), &mut self.points);
                let filtered = Instant::now();
                self.odometry.push_points(self.points.as_ref(), sink);
                self.timing.filter_ns.push(nanoseconds(begin, filtered));
                let odometry_ns = nanoseconds(filtered, Instant::now());
                self.timing
                    .odometry_ns
                    .push(odometry_ns + std::mem::take(&mut self.since_scan_ns));
            }
            Event::Imu(sample) => {
                self.odometry.push_imu(sample, sink);
                self.since_scan_ns += nanoseconds(begin, Instant::now());
            }
            Event::Truth(_) => {}
        }
    }

    /// The log is at its end.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        self.odometry.finish(sink);
    }

    /// What odometry dropped, repaired or found without support.
    pub fn counters(&self) -> Counters {
        self.odometry.counters()
    }
}

fn nanoseconds(begin: Instant, end: Instant) -> u64 {
    end.duration_since(begin)
        .as_nanos()
        .try_into()
        .unwrap_or(u64::MAX)
}

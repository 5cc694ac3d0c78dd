//! The stages composed in one thread: filter, odometry, mapper. The same code as in the processes.

use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_mapper::Mapper;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints, Topic};
use randt_odometry::{Counters, Odometry, Sink};
use randt_readers::Event;
use std::time::Instant;

/// Filter, odometry and mapper, with what they cost.
pub struct Pipeline {
    filter: ClusterFilter,
    points: Message<RadarPoints>,
    odometry: Odometry,
    mapper: Mapper,
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
    /// Loops, graph and grid, per keyframe.
    pub mapper_ns: Vec<u64>,
}

impl Timing {
    /// Filter and motion estimation together, per scan, ns.
    pub fn filter_and_odometry_ns(&self) -> Vec<u64> {
        let both = self.filter_ns.iter().zip(&self.odometry_ns);
        both.map(|(filter, odometry)| filter + odometry).collect()
    }
}

/// What odometry publishes goes to the mapper too.
struct Publish<'a, S> {
    sink: &'a mut S,
    mapper: &'a mut Mapper,
    mapper_ns: &'a mut Vec<u64>,
    spent_ns: u64,
}

impl<S: Sink> Sink for Publish<'_, S> {
    fn state(&mut self, state: &OdometryState) {
        self.sink.state(state);
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        let begin = Instant::now();
        self.sink.keyframe(keyframe);
        self.mapper.push(keyframe);
        let spent_ns = nanoseconds(begin, Instant::now());
        self.mapper_ns.push(spent_ns);
        self.spent_ns += spent_ns;
    }
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
            mapper: Mapper::new(config),
            timing: Timing::default(),
            since_scan_ns: 0,
        }
    }

    /// Takes one event of a log; the truth is not looked at.
    pub fn push(&mut self, event: &Event, sink: &mut impl Sink) {
        let begin = Instant::now();
        let mut sink = Publish {
            sink,
            mapper: &mut self.mapper,
            mapper_ns: &mut self.timing.mapper_ns,
            spent_ns: 0,
        };
        match event {
            Event::Scan(scan) => {
                self.filter.process(scan.as_ref(), &mut self.points);
                let filtered = Instant::now();
                self.odometry.push_points(self.points.as_ref(), &mut sink);
                let odometry_ns = nanoseconds(filtered, Instant::now()) - sink.spent_ns;
                self.timing.filter_ns.push(nanoseconds(begin, filtered));
                self.timing
                    .odometry_ns
                    .push(odometry_ns + std::mem::take(&mut self.since_scan_ns));
            }
            Event::Imu(sample) => {
                self.odometry.push_imu(sample, &mut sink);
                self.since_scan_ns += nanoseconds(begin, Instant::now()) - sink.spent_ns;
            }
            Event::Truth(_) => {}
        }
    }

    /// The log is at its end.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        let mut sink = Publish {
            sink,
            mapper: &mut self.mapper,
            mapper_ns: &mut self.timing.mapper_ns,
            spent_ns: 0,
        };
        self.odometry.finish(&mut sink);
        self.mapper.finish();
    }

    /// What odometry dropped, repaired or found without support.
    pub fn counters(&self) -> Counters {
        self.odometry.counters()
    }

    /// The map.
    pub fn mapper(&self) -> &Mapper {
        &self.mapper
    }
}

fn nanoseconds(begin: Instant, end: Instant) -> u64 {
    end.duration_since(begin)
        .as_nanos()
        .try_into()
        .unwrap_or(u64::MAX)
}

//! The stages composed in one thread: filter, odometry, mapper. The same code as in the processes.

use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_mapper::{MapKeyframe, Mapper};
use randt_messages::{
    Keyframe, KeyframeHead, Message, MessageRef, OdometryState, RadarPoints, Topic,
};
use randt_odometry::{Counters, Odometry, Sink};
use randt_readers::Event;
use std::time::Instant;

/// Filter, odometry and mapper, with what they cost.
pub struct Pipeline {
    filter: ClusterFilter,
    points: Message<RadarPoints>,
    odometry: Odometry,
    mapper: Mapper,
    joint: Joint,
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

/// Where odometry's keyframes meet a map that has some of them already.
#[derive(Clone, Copy, Debug)]
struct Joint {
    /// Whether odometry and map are of one drive: shown by a keyframe that both have, to the last
    /// bit.
    is_shown: bool,
    /// Keyframes that the map did not take because that was not so.
    refused: u64,
}

impl Joint {
    /// Whether the map takes a keyframe.
    fn takes(&mut self, mapper: &Mapper, head: &KeyframeHead) -> bool {
        let last = mapper.keyframes().last();
        if let Some(last) = last.filter(|last| head.id <= last.keyframe_id) {
            if head.id == last.keyframe_id {
                self.is_shown = last.stamp_ns == head.header.stamp_ns
                    && last.odom_frame_id == head.odom_frame_id
                    && last.odom_from_base.to_array() == head.pose;
            }
            // The map has it.
            return false;
        }
        self.refused += u64::from(!self.is_shown);
        self.is_shown
    }
}

/// What odometry publishes goes to the mapper too.
struct Publish<'a, S> {
    sink: &'a mut S,
    mapper: &'a mut Mapper,
    joint: &'a mut Joint,
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
        if self.joint.takes(self.mapper, keyframe.head) {
            self.mapper.push(keyframe);
        }
        let spent_ns = nanoseconds(begin, Instant::now());
        self.mapper_ns.push(spent_ns);
        self.spent_ns += spent_ns;
    }
}

impl Pipeline {
    /// Ready for the first event.
    pub fn new(config: &Config, use_imu: bool) -> Self {
        let odometry = Odometry::new(config, use_imu);
        Self::resume(config, odometry, Mapper::new(config), true)
    }

    /// Goes on from an estimate and a map that there are. `is_one_drive`: whether the estimate's
    /// next keyframe is known to follow the map's last one; where it is not, the map takes none
    /// before odometry has given that last one again, bit for bit.
    pub fn resume(config: &Config, odometry: Odometry, mapper: Mapper, is_one_drive: bool) -> Self {
        let mut points = Message::<RadarPoints>::default();
        // Room for every scan from the start: nothing grows later.
        points.items.reserve(RadarPoints::MAX_ITEMS);
        Self {
            filter: ClusterFilter::new(&config.filter, &config.sensor),
            points,
            odometry,
            joint: Joint {
                is_shown: is_one_drive || mapper.keyframes().is_empty(),
                refused: 0,
            },
            mapper,
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
            joint: &mut self.joint,
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
            Event::Twist(twist) => self.odometry.push_twist(twist, &mut sink),
            Event::Truth(_) => {}
        }
    }

    /// The log is at its end.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        let mut sink = Publish {
            sink,
            mapper: &mut self.mapper,
            joint: &mut self.joint,
            mapper_ns: &mut self.timing.mapper_ns,
            spent_ns: 0,
        };
        self.odometry.finish(&mut sink);
        self.mapper.finish();
    }

    /// The estimate.
    pub fn odometry(&self) -> &Odometry {
        &self.odometry
    }

    /// Numbers the estimate's frames on after this one, and its keyframes after the map's of
    /// frames up to it: what a start without a past does when it receives a map.
    pub fn continue_after(&mut self, odom_frame_id: u64) {
        let before = |keyframe: &&MapKeyframe| keyframe.odom_frame_id <= odom_frame_id;
        let last = self.mapper.keyframes().iter().rev().find(before);
        let next = last.map_or(0, |keyframe| keyframe.keyframe_id + 1);
        self.odometry.continue_after(next, odom_frame_id);
    }

    /// Whether the estimate is known to be of the map's drive.
    pub fn is_one_drive(&self) -> bool {
        self.joint.is_shown
    }

    /// Puts one in the estimate's place that knows nothing, and has nothing to add to the map.
    pub fn forget_odometry(&mut self, config: &Config) {
        self.odometry = Odometry::new(config, false);
        self.joint.refused = 0;
    }

    /// Keyframes that the map did not take, because nothing shows that they are of its drive.
    pub fn keyframes_refused(&self) -> u64 {
        self.joint.refused
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

#[cfg(test)]
mod tests;

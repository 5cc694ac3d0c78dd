//! A recording to a trajectory: the stages' own structs in one thread, as `randt run` has them.
//!
//! ```text
//! cargo run -p randt-examples --bin offline_run -- DRIVE.mcap > trajectory.tum
//! ```

use anyhow::Context;
use randt_config::{Config, Selection};
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_geometry::elementary::sin_cos;
use randt_mapper::Mapper;
use randt_messages::{Event, Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Odometry, Sink};
use randt_readers::Options;
use std::path::PathBuf;

/// Takes what odometry publishes: every state, and a keyframe when its scan is final.
struct Map(Mapper);

impl Sink for Map {
    fn state(&mut self, _state: &OdometryState) {}

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.0.push(keyframe);
    }
}

fn main() -> anyhow::Result<()> {
    let input = std::env::args_os().nth(1).map(PathBuf::from);
    let input = input.context("usage: offline_run INPUT")?;
    let mut source = randt_readers::open(&input, &Options::default())?;

    // The radar that the input names, the mixed profile, and the sensors where the input has them.
    let sensor = source.info().sensor.name();
    let mut loaded = Config::load(&Selection {
        sensor_from_input: sensor,
        ..Selection::default()
    })?;
    if let Some(radar) = source.info().extrinsics.radar {
        let robot = &mut loaded.config.robot;
        (robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad) =
            (radar.x_m, radar.y_m, radar.yaw_rad);
    }
    if let Some(imu) = source.info().extrinsics.imu {
        let robot = &mut loaded.config.robot;
        (robot.imu_roll_rad, robot.imu_pitch_rad, robot.imu_yaw_rad) = imu.roll_pitch_yaw();
    }
    let config = loaded.config;

    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(&config, true);
    let mut map = Map(Mapper::new(&config));
    while let Some(event) = source.next_event()? {
        match event {
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut map);
            }
            Event::Imu(sample) => odometry.push_imu(&sample, &mut map),
            Event::Twist(twist) => odometry.push_twist(&twist, &mut map),
            Event::Truth(_) => {}
        }
    }
    odometry.finish(&mut map);
    let Map(mut mapper) = map;
    mapper.finish();

    // The keyframes, as the pose graph has them after every loop.
    for (keyframe, pose) in mapper.keyframes().iter().zip(mapper.poses()) {
        println!("{}", tum(keyframe.stamp_ns, pose));
    }
    let loops = mapper.accepted().count();
    eprintln!("{} keyframes, {loops} loops", mapper.poses().len());
    Ok(())
}

/// A row of a TUM file: stamp s, position m, quaternion x y z w.
fn tum(stamp_ns: i64, pose: &Pose2) -> String {
    let (seconds, nanoseconds) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
    let (sin, cos) = sin_cos(pose.yaw_rad / 2.0);
    let (x_m, y_m) = (pose.x_m, pose.y_m);
    format!("{seconds}.{nanoseconds:09} {x_m:.9} {y_m:.9} 0 0 0 {sin:.9} {cos:.9}")
}

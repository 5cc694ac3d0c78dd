//! Prints the robot's pose in the map, live, as CSV.
//!
//! ```text
//! cargo run -p randt-examples --bin follow_pose -- [--prefix NAME] [--run DIR] [--scans N]
//! ```

use clap::Parser;
use randt_geometry::Pose2;
use randt_messages::{MapperCorrection, OdometryState, OdometryStateTopic};
use randt_stage::{DomainArguments, Observer, ended};
use std::collections::BTreeMap;
use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

/// Follows the robot's pose.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    domain: DomainArguments,
    /// End after that many
    #[arg(long, default_value_t = u64::MAX)]
    scans: u64,
}

fn main() -> ExitCode {
    ended("follow_pose", run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let observer = Observer::enter(&arguments.domain.domain()?)?.ok_or("no stage lives there")?;
    let mut states = observer.subscriber::<OdometryStateTopic>()?;
    let mut corrections = observer.subscriber::<MapperCorrection>()?;
    // The newest place of each odometry frame in the map. A frame that has none yet is not joined
    // to the map: its poses are only true within it.
    let mut map_from_odom = BTreeMap::new();
    let mut left = arguments.scans;
    println!("stamp_ns,frame,x_m,y_m,yaw_rad,trust");
    while left > 0 {
        observer.wait(&states, Duration::from_millis(500))?;
        // Where a stage has lost its memory, a reader has too: it ends, and is started anew.
        observer.check_memory()?;
        observer.read(&mut corrections, |message| {
            let correction = message.head;
            map_from_odom.insert(
                correction.odom_frame_id,
                Pose2::from_array(correction.map_from_odom),
            );
        })?;
        observer.read(&mut states, |message| {
            if left > 0 {
                print(message.head, map_from_odom.get(&message.head.odom_frame_id));
                left -= 1;
            }
        })?;
    }
    Ok(())
}

fn print(state: &OdometryState, map_from_odom: Option<&Pose2>) {
    let pose = Pose2::from_array(state.pose);
    let (frame, pose) = match map_from_odom {
        Some(map_from_odom) => ("map", map_from_odom.compose(&pose)),
        None => ("odom", pose),
    };
    println!(
        "{},{frame},{:.4},{:.4},{:.5},{}",
        state.header.stamp_ns,
        pose.x_m,
        pose.y_m,
        pose.yaw_rad,
        state.trust().as_str(),
    );
}

//! A process of one's own on the bus: an odometer, which adds up the way driven and publishes it.
//! Killed at any moment and started again, it goes on with what it had.
//!
//! ```text
//! randt up --play DRIVE.mcap &
//! cargo run -p randt-examples --bin custom_stage
//! ```

use clap::Parser;
use randt_geometry::Pose2;
use randt_messages::{Header, Message, OdometryStateTopic};
use randt_stage::{Checkpoint, DomainArguments, Stage, WakeReason, ended};
use std::error::Error;
use std::process::ExitCode;

/// Adds up the way driven.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    domain: DomainArguments,
}

randt_messages::plain! {
    /// The way driven, and the state that it reaches to.
    pub struct Odometer {
        /// Stamp: that of the odometry's state.
        pub header: Header,
        /// In all, m.
        pub driven_m: f64,
        /// Number of the last state that is in it, plus one; 0 before the first.
        pub states: u64,
        /// The odometry frame of that state.
        pub odom_frame_id: u64,
        /// Its pose: x m, y m, yaw rad.
        pub pose: [f64; 3],
    }
}
randt_messages::topic! {
    /// Topic of [`Odometer`].
    OdometerTopic = "example/odometer/v1": Odometer, [(); 0];
}

fn main() -> ExitCode {
    ended("odometer", run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut stage = Stage::open("odometer", &arguments.domain.domain()?)?;
    // What must outlive this process, in the domain's folder in memory: two versions, one of which
    // is always whole.
    let path = stage.domain().state().join("odometer.state");
    let mut checkpoint = Checkpoint::open(&path, size_of::<Odometer>())?;
    let mut message = Message::<OdometerTopic>::default();
    if let Some(newest) = checkpoint.versions().first() {
        *message.head = bytemuck::pod_read_unaligned(newest);
    }

    let mut odometer = stage.publisher::<OdometerTopic>()?;
    let mut states = stage.subscriber::<OdometryStateTopic>()?;
    stage.running()?;
    loop {
        while let Some(received) = states.receive()? {
            let state = received.message().head;
            let head = &mut *message.head;
            // The history hands out states once more that are in the sum.
            if state.id < head.states {
                continue;
            }
            // Poses of two odometry frames are not comparable.
            if head.states > 0 && head.odom_frame_id == state.odom_frame_id {
                let step = Pose2::from_array(head.pose).between(&Pose2::from_array(state.pose));
                head.driven_m += (step.x_m * step.x_m + step.y_m * step.y_m).sqrt();
            }
            head.header.stamp_ns = state.header.stamp_ns;
            (head.states, head.odom_frame_id) = (state.id + 1, state.odom_frame_id);
            head.pose = state.pose;
            // Written before it is published: what others have seen survives this process.
            let bytes = bytemuck::bytes_of(&*message.head);
            checkpoint.write(|slot| {
                slot.get_mut(..bytes.len())
                    .ok_or("the slot is too small")?
                    .copy_from_slice(bytes);
                Ok::<_, &str>(bytes.len())
            })?;
            odometer.publish(message.as_ref())?;
            println!("{:.2} m", message.head.driven_m);
        }
        if stage.wait(&[&states], None)? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
    }
}

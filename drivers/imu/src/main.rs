//! `randt-imu`: an IMU to imu/sample, and wheels by lines to robot/twist, as a process.

use clap::Parser;
use randt_imu::Imu;
use randt_messages::{ImuSampleTopic, MessageRef, TwistTopic};
use randt_stage::{Descriptor, Publisher, StageArguments, Waitable, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

/// The IMU's driver: a Phidgets Spatial, a MicroStrain, an Xsens, or any that sends text lines, as
/// configured in section [imu] of robot.toml. Wheels that send such lines are read, too.
///
/// A device that is not there is waited for, and one that was unplugged is found again.
#[derive(Debug, Parser)]
#[command(name = "randt-imu", max_term_width = 100)]
struct Arguments {
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("imu", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let loaded = arguments.stage.selection.load(None)?;
    let imu = Imu::new(&loaded.config);
    let mut imu = imu.map_err(|error| error.in_configuration(&loaded.origins))?;
    let mut stage = arguments.stage.open("imu")?;
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &loaded.config, &["robot"], Some("imu"));
    let mut lost_before = 0;
    let mut samples = stage.publisher::<ImuSampleTopic>()?;
    let mut twists: Option<Publisher<TwistTopic>> = None;
    if imu.has_twists() {
        twists = Some(stage.publisher()?);
    }
    stage.running()?;
    loop {
        let mut failed = None;
        imu.poll_by(&|| stage.clock().now_ns(), &mut |head| {
            let sent = samples.publish(MessageRef { head, items: &[] });
            failed = failed.take().or(sent.err());
        });
        if let Some(error) = failed {
            return Err(error.into());
        }
        for head in imu.drain_twists() {
            if let Some(twists) = &mut twists {
                let (head, items) = (&head, &[]);
                twists.publish(MessageRef { head, items })?;
            }
        }
        stage.set_status(imu.link().text(), lost_before + imu.lost());
        let pause_ns = imu.due_ns().saturating_sub(stage.clock().now_ns()).max(0);
        let pause = Duration::from_nanos(pause_ns.unsigned_abs());
        let descriptors = [imu.descriptor(), imu.twist_descriptor()];
        let descriptors = descriptors.into_iter().flatten().map(Descriptor::new);
        let descriptors = descriptors.collect::<Result<Vec<_>, _>>()?;
        let devices: Vec<&dyn Waitable> = descriptors.iter().map(|it| it as _).collect();
        if stage.wait(&devices, Some(pause))? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
        match stage.take_changed().map(|config| Imu::new(&config)) {
            Some(Ok(other)) => {
                lost_before += imu.lost();
                imu = other;
                if imu.has_twists() && twists.is_none() {
                    twists = Some(stage.publisher()?);
                }
            }
            Some(Err(error)) => stage.log_info(&format!("the IMU stays as it was: {error}")),
            None => {}
        }
    }
}

//! `randt-imu`: an IMU to imu/sample, as a process.

use clap::Parser;
use randt_imu::Imu;
use randt_messages::{ImuSampleTopic, MessageRef};
use randt_stage::{Descriptor, StageArguments, Waitable, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

/// The IMU's driver: a Phidgets Spatial, a MicroStrain or an Xsens, as configured in section [imu]
/// of robot.toml.
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
        stage.set_status(imu.link().text(), lost_before + imu.lost());
        let pause_ns = imu.due_ns().saturating_sub(stage.clock().now_ns()).max(0);
        let pause = Duration::from_nanos(pause_ns.unsigned_abs());
        let descriptor = imu.descriptor().map(Descriptor::new).transpose()?;
        let device = descriptor.as_ref().map(|device| device as &dyn Waitable);
        if stage.wait(device.as_slice(), Some(pause))? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
        match stage.take_changed().map(|config| Imu::new(&config)) {
            Some(Ok(other)) => {
                lost_before += imu.lost();
                imu = other;
            }
            Some(Err(error)) => stage.log_info(&format!("the IMU stays as it was: {error}")),
            None => {}
        }
    }
}

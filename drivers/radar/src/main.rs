//! `randt-radar`: a radar to radar/scan, as a process.

use clap::Parser;
use randt_messages::{RadarScan, SensorKind};
use randt_radar::{Radar, Sweep};
use randt_stage::{Descriptor, Publisher, StageArguments, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

/// The radar's driver: every sweep of the radar in section [radar] of the configuration.
///
/// A radar that is not there, or not any more, is no error: the stage's status shows it, and it is
/// tried without end.
#[derive(Debug, Parser)]
#[command(name = "randt-radar", max_term_width = 100)]
struct Arguments {
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("radar", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let loaded = arguments.stage.selection.load(None)?;
    let config = loaded.config;
    let radar = Radar::new(&config);
    let mut radar =
        radar.map_err(|error| -> Box<dyn Error> { error.in_configuration(&loaded.origins) })?;
    let sensor = SensorKind::from_name(&config.sensor.name);
    let mut stage = arguments.stage.open("radar")?;
    stage.expect_sensor(&config.sensor);
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["record", "sensor"], Some("radar"));
    let mut scans = stage.publisher::<RadarScan>()?;
    let mut failure = None;
    let mut lost_before = 0;
    stage.running()?;
    loop {
        radar.poll(stage.clock().now_ns(), &mut |sweep| {
            if let Err(error) = publish(&mut scans, sweep, sensor) {
                failure.get_or_insert(error);
            }
        });
        if let Some(error) = failure.take() {
            return Err(error.into());
        }
        stage.set_status(radar.link().text(), lost_before + radar.lost());
        let pause_ns = radar.due_ns().saturating_sub(stage.clock().now_ns());
        let pause = Duration::from_nanos(pause_ns.max(0).unsigned_abs());
        let descriptor = Descriptor::new(radar.descriptor())?;
        if stage.wait(&[&descriptor], Some(pause))? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
        match stage.take_changed().map(|config| Radar::new(&config)) {
            Some(Ok(other)) => {
                lost_before += radar.lost();
                radar = other;
            }
            Some(Err(error)) => stage.log_info(&format!("the radar stays as it was: {error}")),
            None => {}
        }
    }
}

/// Lays a sweep out where its readers will find it.
fn publish(
    scans: &mut Publisher<RadarScan>,
    sweep: &Sweep,
    sensor: SensorKind,
) -> Result<(), randt_stage::Error> {
    let mut loan = scans.loan(sweep.len())?;
    sweep.write_head(sensor, loan.head_mut());
    sweep.write_items(loan.items_mut());
    scans.publish_loan(loan)
}

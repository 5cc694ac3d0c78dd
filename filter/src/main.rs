//! `randt-filter`: radar/scan to radar/points, as a process.

use clap::Parser;
use randt_filter::{ClusterFilter, check_sweep};
use randt_messages::{Message, RadarPoints, RadarScan};
use randt_stage::{StageArguments, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;

/// The filter stage: reduces every sweep of the radar to the returns that matter.
///
/// It remembers nothing: when it is started again it filters what is still in reach once more, and whoever reads the
/// points knows each scan by its number.
#[derive(Debug, Parser)]
#[command(name = "randt-filter", version, max_term_width = 100)]
struct Arguments {
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("filter", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = arguments.stage.selection.load(None)?.config;
    let mut stage = arguments.stage.open("filter")?;
    stage.expect_sensor(&config.sensor);
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["filter", "sensor"], None);
    let mut points = stage.publisher::<RadarPoints>()?;
    let mut scans = stage.subscriber::<RadarScan>()?;
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut filtered = Message::default();
    let mut misfits = 0;
    stage.running()?;
    loop {
        while let Some(scan) = scans.receive()? {
            let scan = scan.message();
            if let Err(misfit) = check_sweep(&scan.head.sweep, &config) {
                misfits += 1;
                stage.set_status(&misfit.to_string(), misfits);
                continue;
            }
            filter.process(scan, &mut filtered);
            points.publish(filtered.as_ref())?;
        }
        if stage.wait(&[&scans], None)? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
    }
}

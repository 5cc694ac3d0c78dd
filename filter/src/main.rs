//! `randt-filter`: radar/scan to radar/points, as a process.

use clap::Parser;
use randt_filter::{ClusterFilter, check_sweep};
use randt_messages::{RadarPoints, RadarScan};
use randt_stage::{StageArguments, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;

/// The filter stage: reduces every sweep of the radar to the returns that matter.
///
/// It has no state: when it is started again it filters the sweeps that are still in the history
/// once more, and readers of the points recognise each scan by its number.
#[derive(Debug, Parser)]
#[command(name = "randt-filter", max_term_width = 100)]
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
            // Into shared memory, where the readers of the points find them.
            let filtered = filter.filter(scan);
            let mut loan = points.loan(filtered.len)?;
            filtered.write_head(loan.head_mut());
            filtered.write_items(loan.items_mut());
            points.publish_loan(loan)?;
        }
        if stage.wait(&[&scans], None)? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
    }
}

//! `randt doctor sensors`: whether radar and IMU answer, and make sense.

mod capture;
mod estimate;
mod imu;
mod radar;
mod rates;
mod turning;

use super::print_findings;
use crate::commands::up::check_drivers;
use crate::exit::Outcome;
use randt_config::SelectionArguments;
use randt_stage::DomainArguments;
use std::time::Duration;

/// Arguments of `randt doctor sensors`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// How long to read them, s; turn the robot meanwhile to see whether radar and gyro turn the
    /// same way
    #[arg(long, value_name = "S", default_value = "5", value_parser = clap::value_parser!(u32).range(2..=3600))]
    seconds: u32,
    /// Do not check the IMU
    #[arg(long)]
    no_imu: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    domain: DomainArguments,
}

/// Reads both sensors at once: through their drivers where these run, else by drivers of its own.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let loaded = arguments.selection.load(None)?;
    check_drivers(&loaded, arguments.no_imu)?;
    let mut config = loaded.config;
    // The check leaves nothing behind.
    config.record.dense.clear();
    let domain = arguments.domain.domain()?;
    let time = Duration::from_secs(u64::from(arguments.seconds));
    eprintln!("looking for {} s", arguments.seconds);
    let seen = capture::capture(&config, &domain, time, !arguments.no_imu)?;
    let mut findings = radar::check(&config, &seen.radar);
    if let Some(of_imu) = &seen.imu {
        findings.extend(imu::check(&config, of_imu));
        findings.push(radar::check_sense(&seen.radar, of_imu));
    }
    findings.extend(seen.estimate.check(seen.twists.len()));
    let imu = if arguments.no_imu {
        String::new()
    } else {
        format!(", IMU: {}", config.imu.source.name())
    };
    print_findings(
        arguments.json,
        &format!("radar: {}{imu}", config.radar.source.name()),
        &findings,
    )
}

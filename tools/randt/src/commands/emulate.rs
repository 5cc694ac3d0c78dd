//! `randt emulate`: sensors that are not there, in their own protocols.

mod imu;
mod radar;

use crate::exit::Outcome;
use crate::input::number_within;
use clap::{Args, Subcommand};
use randt_emulator::{Fault, FaultKind, Faults};
use std::path::PathBuf;

/// What is emulated.
#[derive(Debug, Subcommand)]
pub enum Sensor {
    /// A radar over Ethernet
    Radar(radar::Arguments),
    /// An IMU on a serial port, or on a Phidget network server
    Imu(imu::Arguments),
}

/// The options of every emulator.
#[derive(Debug, Args)]
struct Common {
    /// Our log of a drive (`randt simulate`, or `randt import` of a recording)
    #[arg(long, value_name = "LOG")]
    log: PathBuf,
    /// From the beginning again when it is at its end, until Ctrl-C
    #[arg(long = "loop")]
    endless: bool,
    /// When it begins, seconds since 1970; the log's first stamp comes half a second later. Two
    /// emulators with the same second are on one clock; if not given, now
    #[arg(long, value_name = "UNIX_S", value_parser = seconds)]
    at: Option<f64>,
    /// What goes wrong and when, in seconds since the beginning, such as silence@10+2; may be
    /// given again
    #[arg(long = "fault", value_name = "KIND@BEGIN+DURATION", long_help = fault_help())]
    faults: Vec<Fault>,
    /// Seed of what is random in the faults
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// End with this process, which has started this one
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

impl Common {
    /// Lets Ctrl-C end it; what goes wrong.
    fn begin(&self) -> Faults {
        if let Some(parent) = self.parent {
            randt_stage::end_with(parent);
        }
        crate::job::catch_interrupts();
        Faults::new(self.faults.clone()).seeded(self.seed)
    }
}

fn fault_help() -> String {
    let mut help =
        "What goes wrong and when, in seconds since the beginning; may be given again. One that the \
         protocol cannot have is refused:\n"
            .to_owned();
    for kind in FaultKind::ALL {
        help.push_str(&format!("  {:12} {}\n", kind.name(), kind.about()));
    }
    help
}

fn seconds(text: &str) -> Result<f64, String> {
    number_within(text, 0.0..1e10, "seconds since 1970")
}

/// Emulates until the log is at its end, or the end is asked for.
pub fn run(sensor: Sensor) -> anyhow::Result<Outcome> {
    match sensor {
        Sensor::Radar(arguments) => radar::run(arguments),
        Sensor::Imu(arguments) => imu::run(arguments),
    }
}

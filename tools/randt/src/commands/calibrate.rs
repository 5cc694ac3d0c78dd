//! `randt calibrate`: time offset and mounting of the radar, from a drive (docs/calibrate.md).
//!
//! Responsible for arguments and for what is printed and written. The estimates are
//! `randt_calibration`'s.

mod extrinsics;
mod path;
mod time;

use crate::exit::Outcome;
use crate::input::InputOptions;
use randt_calibration::Span;
use randt_config::SelectionArguments;
use std::path::PathBuf;

/// More stretches than these stand in the JSON only.
const SPANS_SHOWN: usize = 8;

/// What is calibrated.
#[derive(Debug, clap::Subcommand)]
pub enum What {
    /// How late the radar's stamps are against the gyro's
    Time(Recording),
    /// Where the radar sits in base_link: its yaw from straights, its position from turns on the
    /// spot
    Extrinsics(extrinsics::Arguments),
}

/// What both read.
#[derive(Debug, clap::Args)]
pub struct Recording {
    /// A log of a drive as docs/calibrate.md describes it, in any format that `randt run` reads
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    options: InputOptions,
}

/// Estimates and prints.
pub fn run(what: What) -> anyhow::Result<Outcome> {
    match what {
        What::Time(recording) => time::run(&recording),
        What::Extrinsics(arguments) => extrinsics::run(&arguments),
    }
}

/// Spans of a log in words: the first ones, and how many more.
fn spans(path: &path::Path, spans: &[Span]) -> String {
    let words = spans.iter().take(SPANS_SHOWN).map(|span| {
        let [begin_s, end_s] = path.seconds(span);
        format!("{begin_s:.0}..{end_s:.0}")
    });
    let more = match spans.len().saturating_sub(SPANS_SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more} s", words.collect::<Vec<_>>().join(", "))
}

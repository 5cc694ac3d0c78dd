//! `randt plot`: pictures of what is in a log, without any viewer. Nothing is computed that the
//! log does not hold.

mod charts;
mod path;
mod recording;
mod topics;

use crate::exit::Outcome;
use crate::output::{prepare_folder, print, write_whole};
use crate::{job, results};
use charts::Panels;
use randt_evaluation::{Chart, Panel, plot_chart};
use recording::Recording;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `randt plot`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// One of our logs, finished or not, a folder of them, or a mission
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Folder for the pictures; if not given, named after it, beside it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// A picture, or what the log lacks for it.
type Picture = Result<String, &'static str>;

/// Panels of a chart from a recording.
type PanelsOf = fn(&Recording) -> Panels;

/// Reads the log through, draws and lists what was drawn.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    job::catch_interrupts();
    let recording = Recording::read(&arguments.log)?;
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| arguments.log.with_extension("plots"));
    prepare_folder(&out)?;
    let name = arguments.log.file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let charts: [(&str, &str, PanelsOf); 5] = [
        ("motion.svg", "speed and yaw rate", charts::motion),
        ("quality.svg", "how well scans fit", charts::quality),
        ("latency.svg", "latency", charts::latency),
        ("topics.svg", "messages on each topic", topics::panels),
        ("biases.svg", "gyro biases and attitude", charts::biases),
    ];
    let title = |what: &str| format!("{name}: {what}");
    let mut pictures: Vec<(&str, &str, Picture)> = Vec::new();
    let what = "path over the map";
    pictures.push(("path.svg", what, path::draw(&recording, &title(what))?));
    for (file, what, panels) in charts {
        let drawn = match panels(&recording) {
            Ok(panels) => Ok(chart(&recording, &title(what), &panels)?),
            Err(lacks) => Err(lacks),
        };
        pictures.push((file, what, drawn));
    }
    let mut index = String::new();
    for (file, what, picture) in pictures {
        let path = out.join(file);
        match picture {
            Ok(svg) => {
                write_whole(&path, svg.as_bytes())?;
                // Writing to a String cannot fail.
                let _ = writeln!(index, "{}  {what}", path.display());
            }
            Err(lacks) => {
                // One of an earlier log must not stand for it.
                results::remove(&path)?;
                eprintln!("left out: {file}: the log has no {lacks}");
            }
        }
    }
    print(&index)?;
    if recording.states.is_empty() {
        let log = arguments.log.display();
        eprintln!(
            "note: the log has no odometry/state, so what follows from it is not drawn; \
             `randt run {log} --out DIR` computes path and map, and \
             `randt up --play {log} --out DIR --record LOGS` records a log with everything"
        );
    }
    for damage in &recording.damage {
        eprintln!("stepped over: {damage}");
    }
    Ok(Outcome::finished(!recording.damage.is_empty()))
}

fn chart(recording: &Recording, title: &str, panels: &[Panel]) -> anyhow::Result<String> {
    Ok(plot_chart(&Chart {
        title,
        since: "the log's beginning",
        span_s: recording.span_s(),
        panels,
    })?)
}

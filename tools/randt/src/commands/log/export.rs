//! `randt log export`: a log in another format.

mod csv;
mod foxglove;
mod layout;
mod ros1;
mod ros2;
mod tum;

use crate::exit::Outcome;
use crate::output::{print, warn};
use anyhow::{Context, ensure};
use clap::ValueEnum;
use randt_log::LogReader;
use std::fs;
use std::path::{Path, PathBuf};

/// Arguments of `randt log export`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The log
    file: PathBuf,
    /// The format
    #[arg(long, value_name = "FORMAT", required_unless_present = "foxglove")]
    to: Option<Format>,
    /// The same as --to foxglove
    #[arg(long, conflicts_with = "to")]
    foxglove: bool,
    /// What is written: a folder for csv, tum and ros2, a file for ros1 and foxglove; if not
    /// given, named after the log, beside it
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// csv: also the items of messages (returns, points, cells), in files of their own
    #[arg(long)]
    items: bool,
    /// Overwrite what exists
    #[arg(long)]
    force: bool,
}

/// What a log can become.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// A table a topic, with every number of every message
    Csv,
    /// Trajectories: odometry, the same as corrected by the map, the truth where there is one
    Tum,
    /// A ROS 1 bag: PointCloud2, Imu, Odometry and transforms
    Ros1,
    /// A ROS 2 bag in MCAP, as a folder: the same
    Ros2,
    /// An MCAP for Foxglove and Lichtblick: every cloud, NDT cells, pose graph, loops, grid, pose
    /// and transforms
    Foxglove,
}

/// Exports.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut reader = LogReader::open(&arguments.file)?;
    // One of both is there: clap has seen to it.
    let format = arguments.to.unwrap_or(Format::Foxglove);
    let ending = match format {
        Format::Csv => "csv",
        Format::Tum => "tum",
        Format::Ros1 => "bag",
        Format::Ros2 => "ros2",
        Format::Foxglove => "foxglove.mcap",
    };
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| arguments.file.with_extension(ending));
    let shown = out.display();
    let is_free = arguments.force || !out.exists();
    ensure!(is_free, "{shown}: exists already; --force overwrites it");
    ensure!(
        !is_same(&out, &arguments.file),
        "{shown}: is the log itself"
    );
    let text = match format {
        Format::Csv => csv::export(&mut reader, &folder(&out)?, arguments.items),
        Format::Tum => tum::export(&mut reader, &folder(&out)?),
        Format::Ros1 => ros1::export(&mut reader, &out),
        Format::Ros2 => ros2::export(&mut reader, &folder(&out)?),
        Format::Foxglove => foxglove::export(&mut reader, &out),
    }?;
    print(&format!("{shown}: {text}\n"))?;
    reader.translated().for_each(|text| warn(&text));
    for damage in reader.damage() {
        eprintln!("  stepped over: {}", damage.first);
    }
    Ok(Outcome::finished(!reader.damage().is_empty()))
}

/// Whether both are one file, by whichever names; one that is not there is none.
fn is_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

fn folder(path: &Path) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(path).with_context(|| path.display().to_string())?;
    Ok(path.to_owned())
}

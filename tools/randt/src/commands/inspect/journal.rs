//! What a mapper's journal holds.

use super::{CounterRow, quoted};
use crate::exit::Outcome;
use crate::journal_input::JournalInput;
use crate::output::print_value;
use crate::units::count;
use randt_geometry::Pose2;
use serde::Serialize;
use std::path::Path;

/// What was found. The fields are the keys of the JSON object.
#[derive(Debug, Serialize)]
struct Journal {
    input: String,
    format: &'static str,
    keyframes: u64,
    odometry_frames: u64,
    duration_s: f64,
    path_m: f64,
    counters: Vec<CounterRow>,
    command: String,
}

/// Reads the journal through and prints.
pub fn run(input: &Path, journal: &Path, as_json: bool) -> anyhow::Result<Outcome> {
    let read = JournalInput::read(journal)?;
    let counters = read
        .counters
        .by_loss(true)
        .map(|(name, counter)| CounterRow {
            name: name.to_owned(),
            count: counter.count,
            loss: true,
            first: counter.first.clone(),
        });
    let frames = read
        .heads
        .chunk_by(|a, b| a.odom_frame_id == b.odom_frame_id);
    let path_m = frames
        .clone()
        .flat_map(|frame| frame.windows(2))
        .map(|pair| match pair {
            [a, b] => {
                let step = Pose2::from_array(a.pose).between(&Pose2::from_array(b.pose));
                step.translation().norm()
            }
            _ => 0.0,
        });
    let ends = read.heads.first().zip(read.heads.last());
    let duration_ns = ends.map_or(0, |(first, last)| {
        last.header.stamp_ns - first.header.stamp_ns
    });
    let found = Journal {
        input: input.display().to_string(),
        format: "journal",
        keyframes: read.heads.len() as u64,
        odometry_frames: frames.count() as u64,
        duration_s: duration_ns as f64 * 1e-9,
        path_m: path_m.sum(),
        counters: counters.collect(),
        command: format!(
            "randt run {} --out RESULTS",
            quoted(input.display().to_string())
        ),
    };
    print_value(as_json, &found, || table(&found))?;
    Ok(match found.keyframes {
        0 => Outcome::Failed,
        _ => Outcome::finished(!found.counters.is_empty()),
    })
}

/// The same for people.
fn table(found: &Journal) -> String {
    let mut text = format!(
        "input      {}: the mapper's journal\nkeyframes  {} in {:.1} s and {}, {:.1} m of path between them\n",
        found.input,
        found.keyframes,
        found.duration_s,
        count(found.odometry_frames, "odometry frame", "odometry frames"),
        found.path_m
    );
    for counter in &found.counters {
        text += &format!(
            "lost       {} {}: {}\n",
            counter.count, counter.name, counter.first
        );
    }
    text += "note       scans between keyframes are not in it: a log has them\n";
    text += &format!("run        {}\n", found.command);
    text
}

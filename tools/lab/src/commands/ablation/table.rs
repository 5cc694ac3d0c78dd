//! The ablation for people: markdown whose columns stand under each other.

use super::{Ablation, Row, WorldFigures};
use std::fmt::Write;

/// Heads of the columns.
const HEADS: [&str; 7] = [
    "variant",
    "ATE, m",
    "worst 1 s, m",
    "worst 1 s, deg",
    "false loops",
    "recall, %",
    "scan, ms (p99)",
];

/// One table a world, with what they were measured on.
pub(super) fn markdown(ablation: &Ablation) -> String {
    let mut text = String::new();
    let seeds = match ablation.seeds.as_slice() {
        [first, .., last] => format!("seeds {first} to {last}"),
        [only] => format!("seed {only}"),
        [] => String::new(),
    };
    // Writing to a String cannot fail.
    for world in &ablation.worlds {
        let _ = writeln!(text, "### {}: {} scans a drive\n", world.world, world.scans);
        text += &table(world);
        text.push('\n');
    }
    let build = if ablation.optimised {
        "release"
    } else {
        "debug"
    };
    let _ = writeln!(
        text,
        "randt {} ({build} build) on {}; {}; {seeds}. Of all drives the median ATE, the worst second, all loops; time \
         is filter and motion estimation, median (p99).",
        ablation.randt, ablation.machine, ablation.configuration
    );
    text
}

fn table(world: &WorldFigures) -> String {
    let mut lines = vec![HEADS.map(str::to_owned)];
    lines.extend(world.rows.iter().map(cells));
    let widths: [usize; HEADS.len()] = std::array::from_fn(|column| {
        let lengths = lines.iter().map(|line| line[column].chars().count());
        lengths.max().unwrap_or_default()
    });
    // Names are read from the left, numbers compared from the right.
    let row = |cells: &[String; HEADS.len()]| {
        let mut text = String::from("|");
        for (column, (cell, width)) in cells.iter().zip(widths).enumerate() {
            text += &match column {
                0 => format!(" {cell:<width$} |"),
                _ => format!(" {cell:>width$} |"),
            };
        }
        text + "\n"
    };
    let rule = std::array::from_fn(|column| match column {
        0 => "-".repeat(widths[column]),
        _ => "-".repeat(widths[column] - 1) + ":",
    });
    let mut text = String::new();
    for (number, line) in lines.iter().enumerate() {
        text += &row(line);
        if number == 0 {
            text += &row(&rule);
        }
    }
    text
}

/// What stands in a row.
fn cells(row: &Row) -> [String; HEADS.len()] {
    let figure = |value: Option<f64>, decimals: usize| match value {
        Some(value) => format!("{value:.decimals$}"),
        None => "-".to_owned(),
    };
    let figures = &row.figures;
    [
        row.variant.to_owned(),
        figure(figures.ate_rmse_m, 3),
        figure(figures.worst_1s_translation_m, 3),
        figure(figures.worst_1s_rotation_deg, 2),
        format!("{} of {}", figures.false_loops, figures.loops),
        figure(figures.recall.map(|share| 100.0 * share), 1),
        format!("{:.2} ({:.2})", figures.median_ms, figures.p99_ms),
    ]
}

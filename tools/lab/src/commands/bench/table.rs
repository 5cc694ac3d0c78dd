//! The bench for people: a row for each world and fault.

use super::figures::Figures;
use super::record::Build;
use super::summary::Group;
use std::fmt::Write;

/// Heads of the columns.
const HEADS: [&str; 15] = [
    "world", "fault", "silent", "false", "frames", "good", "held", "chg/min", "NEES", "in 95",
    "flag", "again", "late", "live", "final",
];

/// What the columns are.
const LEGEND: &str = "\
silent metres; false of all loops; odometry frames, + unjoined; % good of all and
of held scans; changes of trust; NEES over 10 scans, % inside 95 %; s to not good
and to good again after a fault, or a degenerate stretch; stretches flagged late;
live and final ATE, m. Sums of silent, false and late, else medians over seeds.
";

/// The table of some groups.
pub(super) fn table(groups: &[Group<'_>], build: &Build) -> String {
    let mut lines = vec![HEADS.map(str::to_owned)];
    lines.extend(groups.iter().map(cells));
    let widths: [usize; HEADS.len()] = std::array::from_fn(|column| {
        let lengths = lines.iter().map(|line| line[column].chars().count());
        lengths.max().unwrap_or_default()
    });
    let mut text = String::new();
    for line in &lines {
        let mut row = String::new();
        for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
            row += &match column {
                0 | 1 => format!("{cell:<width$} "),
                _ => format!("{cell:>width$} "),
            };
        }
        text += row.trim_end();
        text.push('\n');
    }
    // Writing to a String cannot fail.
    let seeds = groups.iter().map(|group| group.cells.len()).max();
    let _ = writeln!(
        text,
        "\n{LEGEND}randt {}, binary {}; {}; at most {} seeds.",
        build.randt,
        build.binary_sha256,
        build.settings,
        seeds.unwrap_or_default()
    );
    text
}

/// What stands in a row.
fn cells(group: &Group<'_>) -> [String; HEADS.len()] {
    let figure = |value: Option<f64>, decimals: usize| match value {
        Some(value) => format!("{value:.decimals$}"),
        None => "-".to_owned(),
    };
    let median = |of: fn(&Figures) -> Option<f64>, decimals| figure(group.median(of), decimals);
    let sum = |of: fn(&Figures) -> Option<f64>| figure(group.sum(of), 0);
    let percent =
        |of: fn(&Figures) -> Option<f64>| figure(group.median(of).map(|share| 100.0 * share), 1);
    let mut frames = median(|f| f.frames, 0);
    if group.sum(|f| f.unjoined).is_some_and(|sum| sum > 0.0) {
        frames += &format!("+{}", median(|f| f.unjoined, 0));
    }
    [
        group.world.to_owned(),
        group.fault.to_string(),
        sum(|f| f.silent_m),
        format!("{}/{}", sum(|f| f.false_loops), sum(|f| f.loops)),
        frames,
        percent(|f| f.good),
        percent(|f| f.good_of_held),
        median(|f| f.changes_per_min, 1),
        median(|f| f.nees_mean, 1),
        percent(|f| f.nees_inside),
        median(|f| f.flagged_s.or(f.stretch_flagged_s), 1),
        median(|f| f.good_again_s.or(f.stretch_good_again_s), 1),
        sum(|f| f.stretches_late),
        median(|f| f.live_ate_m, 3),
        median(|f| f.final_ate_m, 3),
    ]
}

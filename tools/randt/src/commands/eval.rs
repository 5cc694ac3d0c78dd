//! `randt eval`: how exact a trajectory is.

use crate::exit::Outcome;
use crate::output::print;
use randt_evaluation::{Evaluation, Trajectory, evaluate};
use serde::Serialize;
use std::fmt::Write;

/// Below this share of the truth the figures speak of another drive.
const COVERAGE_MIN: f64 = 0.95;

/// Arguments of `randt eval`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The estimate: TUM rows (stamp x y z qx qy qz qw) or KITTI rows (3 x 4 matrix)
    #[arg(value_name = "EST")]
    estimate: String,
    /// The truth, in the same format
    #[arg(value_name = "TRUTH")]
    truth: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The figures under the names that other programs read; null where one is not defined.
#[derive(Debug, Serialize)]
struct Figures {
    ate_rmse_m: Option<f64>,
    rpe_translation_mean_m: Option<f64>,
    rpe_rotation_mean_deg: Option<f64>,
    kitti_translation_percent: Option<f64>,
    kitti_rotation_deg_per_100m: Option<f64>,
    coverage: f64,
    truth_poses: usize,
    covered_poses: usize,
    frames: usize,
    path_m: f64,
}

/// Reads both, compares, prints. Ends with "data lost" where too little of the truth is covered.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let estimate = Trajectory::read(&arguments.estimate)?;
    let truth = Trajectory::read(&arguments.truth)?;
    let evaluation = evaluate(&estimate, &truth)?;
    let text = if arguments.json {
        format!("{}\n", serde_json::to_string_pretty(&figures(&evaluation))?)
    } else {
        table(&evaluation)
    };
    print(&text)?;
    if evaluation.frames > 1 {
        eprintln!(
            "note: the estimate is in {} frames; they are never spliced: each is aligned by itself, \
             errors are pooled",
            evaluation.frames
        );
    }
    if evaluation.coverage >= COVERAGE_MIN {
        return Ok(Outcome::Good);
    }
    eprintln!(
        "warning: only {:.1} % of the truth is covered, {} % is needed for figures that speak of the \
         whole drive; {}",
        100.0 * evaluation.coverage,
        100.0 * COVERAGE_MIN,
        reason(&evaluation, &estimate, &truth)
    );
    Ok(Outcome::DataLost)
}

/// What the uncovered part may come from.
fn reason(evaluation: &Evaluation, estimate: &Trajectory, truth: &Trajectory) -> String {
    let span = |trajectory: &Trajectory| match trajectory.poses() {
        [first, .., last] => [first.stamp_ns, last.stamp_ns],
        poses => [poses.first().map_or(0, |pose| pose.stamp_ns); 2],
    };
    let seconds = |ns: i64| ns as f64 * 1e-9;
    let [first, last] = span(estimate);
    let [from, to] = span(truth);
    format!(
        "the estimate spans {:.3} to {:.3} s, the truth {:.3} to {:.3} s, and gaps over {:.1} s \
         are not bridged",
        seconds(first),
        seconds(last),
        seconds(from),
        seconds(to),
        evaluation.gap_max_s
    )
}

fn figures(evaluation: &Evaluation) -> Figures {
    Figures {
        ate_rmse_m: evaluation.ate_rmse_m,
        rpe_translation_mean_m: evaluation.rpe_translation_mean_m,
        rpe_rotation_mean_deg: evaluation.rpe_rotation_mean_deg,
        kitti_translation_percent: evaluation.kitti_translation_percent,
        kitti_rotation_deg_per_100m: evaluation.kitti_rotation_deg_per_100m,
        coverage: evaluation.coverage,
        truth_poses: evaluation.truth_poses,
        covered_poses: evaluation.covered_poses,
        frames: evaluation.frames,
        path_m: evaluation.path_m,
    }
}

/// The figures for people.
fn table(evaluation: &Evaluation) -> String {
    let figure = |value: Option<f64>, decimals: usize, unit: &str| match value {
        Some(value) => format!("{value:.decimals$} {unit}"),
        None => "-".to_owned(),
    };
    let mut text = String::new();
    let mut row = |name: &str, values: String, meaning: &str| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<12} {values:<28} {meaning}");
    };
    row(
        "coverage",
        format!("{:.1} %", 100.0 * evaluation.coverage),
        &format!(
            "{} of {} poses of the truth, {:.1} m",
            evaluation.covered_poses, evaluation.truth_poses, evaluation.path_m
        ),
    );
    row(
        "ATE",
        figure(evaluation.ate_rmse_m, 4, "m"),
        "RMSE of positions after rigid alignment",
    );
    row(
        "RPE",
        format!(
            "{}, {}",
            figure(evaluation.rpe_translation_mean_m, 4, "m"),
            figure(evaluation.rpe_rotation_mean_deg, 3, "deg")
        ),
        "mean per pose of the truth",
    );
    row(
        "KITTI drift",
        format!(
            "{}, {}",
            figure(evaluation.kitti_translation_percent, 3, "%"),
            figure(evaluation.kitti_rotation_deg_per_100m, 3, "deg/100 m")
        ),
        match evaluation.kitti_translation_percent {
            Some(_) => "mean over stretches of 100 to 800 m",
            None => "not defined: no stretch of 100 m",
        },
    );
    text
}

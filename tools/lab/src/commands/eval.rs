//! `randt-lab eval`: how exact a trajectory is.

use randt::exit::Outcome;
use randt::found_loops;
use randt::judgement::Judgement;
use randt::output::print_value;
use randt::poses;
use randt::trust_spans;
use randt_evaluation::{
    Evaluation, LoopEvaluation, LoopLimits, SilentlyWrong, Trajectory, Worst, silently_wrong,
};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Below this share of the truth the figures are another drive's.
const COVERAGE_MIN: f64 = 0.95;

/// Arguments of `randt-lab eval`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The estimate: TUM rows (stamp x y z qx qy qz qw), KITTI rows (3 x 4 matrix), or the folder
    /// of a run
    #[arg(value_name = "EST")]
    estimate: String,
    /// The truth, in the same format, Oxford's radar_odometry.csv, Boreas' radar_poses.csv,
    /// MulRan's global_pose.csv, or a log with true poses
    #[arg(value_name = "TRUTH")]
    truth: String,
    /// Judge the accepted loops of a run by its report.json
    #[arg(long, value_name = "REPORT")]
    loops: Option<PathBuf>,
    /// Count the metres that were wrong under good trust, by a run's report.json; EST is its
    /// odometry.tum
    #[arg(long, value_name = "REPORT")]
    trust: Option<PathBuf>,
    /// A loop is false when it is off by more, m (a Navtech's: 2)
    #[arg(long, value_name = "M", default_value_t = LoopLimits::default().translation_m)]
    false_loop_m: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The figures under the names that other programs read; null where one is not defined. The fields
/// are the keys of the JSON object, which is flat.
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
    lost_track: bool,
    worst_1s_translation_m: Option<f64>,
    worst_1s_rotation_deg: Option<f64>,
    worst_10m_translation_percent: Option<f64>,
    worst_10m_rotation_deg: Option<f64>,
    #[serde(flatten)]
    silently_wrong: Option<SilentlyWrongFigures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    loops: Option<LoopFigures>,
}

/// The same of trust.
#[derive(Debug, Serialize)]
struct SilentlyWrongFigures {
    silent_m: u64,
    wrong_m: u64,
    windows: u64,
    worst_good_10s_m: f64,
    good_share: Option<f64>,
}

/// The same of loops.
#[derive(Debug, Serialize)]
struct LoopFigures {
    loops: usize,
    unjudged: usize,
    false_loops: Vec<FalseLoopFigures>,
    revisits: usize,
    recalled: usize,
    recall: Option<f64>,
}

/// The same of one false loop.
#[derive(Debug, Serialize)]
struct FalseLoopFigures {
    from_ns: i64,
    to_ns: i64,
    error_m: f64,
    error_deg: f64,
}

/// Reads both, compares, prints. Ends with "data lost" where too little of the truth is covered.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let estimate = poses::read(&arguments.estimate)?;
    let truth = poses::read(&arguments.truth)?;
    let limits = LoopLimits {
        translation_m: arguments.false_loop_m,
        ..LoopLimits::default()
    };
    let loops = arguments
        .loops
        .as_deref()
        .map(found_loops::read)
        .transpose()?;
    let found = Judgement::new(&estimate, &truth, loops.as_deref(), &limits)?;
    let trust = arguments.trust.as_deref();
    let trust = trust.map(trust_spans::read).transpose()?;
    let silent = trust.map(|trust| silently_wrong(&estimate, &truth, &trust));
    let figures = figures(&found, silent.as_ref());
    print_value(arguments.json, &figures, || table(&found, silent.as_ref()))?;
    let evaluation = &found.evaluation;
    if evaluation.frames > 1 {
        eprintln!(
            "note: the estimate is in {} frames; they are never spliced: each is aligned by itself, \
             errors are pooled",
            evaluation.frames
        );
    }
    for (name, left_out) in [
        ("estimate", estimate.left_out()),
        ("truth", truth.left_out()),
    ] {
        if left_out.is_flattened() {
            eprintln!(
                "note: the {name} has heights over {:.2} m and tilts up to {:.1} deg; x, y and yaw \
                 alone are compared",
                left_out.height_m(),
                left_out.tilt_deg()
            );
        }
    }
    if evaluation.coverage >= COVERAGE_MIN {
        return Ok(Outcome::Good);
    }
    eprintln!(
        "warning: only {:.1} % of the truth is covered, {} % is needed for figures of the \
         whole drive; {}",
        100.0 * evaluation.coverage,
        100.0 * COVERAGE_MIN,
        reason(evaluation, &estimate, &truth)
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

fn figures(found: &Judgement, silent: Option<&SilentlyWrong>) -> Figures {
    let Judgement {
        evaluation, track, ..
    } = found;
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
        lost_track: track.lost,
        worst_1s_translation_m: track.second.map(|worst| worst.translation),
        worst_1s_rotation_deg: track.second.map(|worst| worst.rotation_deg),
        worst_10m_translation_percent: track.ten_metres.map(|worst| worst.translation),
        worst_10m_rotation_deg: track.ten_metres.map(|worst| worst.rotation_deg),
        silently_wrong: silent.map(|found| SilentlyWrongFigures {
            silent_m: found.silent_m,
            wrong_m: found.wrong_m,
            windows: found.windows,
            worst_good_10s_m: found.worst_good_10s_m,
            good_share: found.good_share,
        }),
        loops: found.loops.as_ref().map(loop_figures),
    }
}

fn loop_figures(loops: &LoopEvaluation) -> LoopFigures {
    LoopFigures {
        loops: loops.loops,
        unjudged: loops.unjudged,
        false_loops: loops
            .false_loops
            .iter()
            .map(|false_loop| FalseLoopFigures {
                from_ns: false_loop.edge.from_ns,
                to_ns: false_loop.edge.to_ns,
                error_m: false_loop.error_m,
                error_deg: false_loop.error_deg,
            })
            .collect(),
        revisits: loops.revisits,
        recalled: loops.recalled,
        recall: loops.recall,
    }
}

/// The figures for people.
fn table(found: &Judgement, silent: Option<&SilentlyWrong>) -> String {
    let Judgement {
        evaluation, track, ..
    } = found;
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
    let worst = |worst: Option<Worst>, unit: &str| {
        format!(
            "{}, {}",
            figure(worst.map(|w| w.translation), 3, unit),
            figure(worst.map(|w| w.rotation_deg), 2, "deg")
        )
    };
    row(
        "worst 1 s",
        worst(track.second, "m"),
        match (track.second, track.lost) {
            (None, _) => "not defined: no second is covered",
            (_, true) => "TRACK LOST: over 0.3 m or 8 deg",
            (_, false) => "track held: none over 0.3 m or 8 deg",
        },
    );
    row(
        "worst 10 m",
        worst(track.ten_metres, "%"),
        "of the path, over 10 m of it",
    );
    if let Some(silent) = silent {
        row(
            "silent",
            format!("{} m of {} m wrong", silent.silent_m, silent.wrong_m),
            "under good trust: off by 0.5 m or 5 deg in 10 m, or by its heading",
        );
        row(
            "trust",
            figure(silent.good_share.map(|share| 100.0 * share), 1, "% good"),
            &format!(
                "share of the scans; worst 10 s of good ones {:.2} m",
                silent.worst_good_10s_m
            ),
        );
    }
    if let Some(loops) = &found.loops {
        row(
            "loops",
            format!("{} false of {}", loops.false_loops.len(), loops.loops),
            &match loops.unjudged {
                0 => "accepted loops against the truth".to_owned(),
                unjudged => format!("{unjudged} of them where there is no truth"),
            },
        );
        row(
            "recall",
            figure(loops.recall.map(|share| 100.0 * share), 1, "%"),
            &format!("{} of {} revisits", loops.recalled, loops.revisits),
        );
        for false_loop in &loops.false_loops {
            let _ = writeln!(
                text,
                "false loop: {:.3} s to {:.3} s is off by {:.2} m, {:.1} deg",
                false_loop.edge.from_ns as f64 * 1e-9,
                false_loop.edge.to_ns as f64 * 1e-9,
                false_loop.error_m,
                false_loop.error_deg
            );
        }
    }
    text
}

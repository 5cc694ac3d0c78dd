//! The end of a drive, for `run`, `up` and missions alike: the window is closed, the map judged as a whole, and the same
//! files, report and summary are written.

mod summary;

use crate::{
    compare::Comparison,
    digest, earlier,
    final_poses::final_poses,
    loops::Loops,
    output::{print, warn, write_whole},
    pipeline::Pipeline,
    report::{self, Accuracy, Cost, Count, Input, Report},
    results::Results,
    trust_spans,
};
use anyhow::{Context, bail};
use randt_config::Config;
use randt_evaluation::silently_wrong;
use randt_messages::OdometryState;
use std::collections::BTreeMap;
use std::path::Path;

/// A drive that is over, but for its end.
pub struct Drive<'a> {
    /// What was read.
    pub input: Input,
    /// Odometry with its window still open, and the map.
    pub pipeline: Pipeline,
    /// The states of every scan so far, and the truth.
    pub results: Results,
    /// Configuration in force.
    pub config: &'a Config,
    /// Everything that was dropped, repaired or assumed, beside what odometry and mapper count themselves.
    pub counters: BTreeMap<&'static str, Count>,
    /// What was published live, where the results are to be compared with that.
    pub published: Option<Vec<OdometryState>>,
}

/// What a computation shows of itself.
#[derive(Debug)]
pub struct Shown {
    /// Error against the log's truth.
    pub ate_rmse_m: Option<f64>,
    /// Length of the path.
    pub path_m: f64,
    /// Cost per stage.
    pub timing: BTreeMap<&'static str, Cost>,
    /// Whether data were lost.
    pub lost: bool,
    /// Whether every pose is the one that was published live, where that was asked.
    pub same: Option<bool>,
}

/// Ends a drive: writes all files into a folder and prints the summary; `None`, and no file, where no scan has a pose.
/// `timing` tells what it cost.
pub fn finish_drive(
    drive: Drive<'_>,
    timing: impl FnOnce(&Pipeline, &[OdometryState]) -> BTreeMap<&'static str, Cost>,
    out: &Path,
) -> anyhow::Result<Option<Shown>> {
    let Drive {
        input,
        mut pipeline,
        mut results,
        config,
        mut counters,
        published,
    } = drive;
    pipeline.finish(&mut results);
    if results.states.is_empty() {
        return Ok(None);
    }
    counters.extend(report::of_pipeline(&pipeline));
    let missing = results.states_missing();
    if missing > 0 {
        let first = "scans that odometry computed, and whose state is nowhere".to_owned();
        counters.insert("states_missing", Count::lost(missing, first));
    }
    let mapper = pipeline.mapper();
    let trajectory = final_poses(&results.states, mapper);
    let evaluation = results.evaluation(&trajectory);
    let odometry = results.odometry();
    let of_odometry = results.evaluation(&odometry);
    let trust_spans = trust_spans::of(&results.states);
    let trust = trust_spans::for_evaluation(&trust_spans);
    let silently_wrong = silently_wrong(&odometry, results.truth(), &trust);
    let mut report = Report {
        randt: env!("CARGO_PKG_VERSION"),
        scans: results.states.len() as u64,
        keyframes: mapper.places().len() as u64,
        path_m: results.path_m(),
        frames: results.frames(),
        trust: results.trust(),
        trust_spans,
        loops: Loops::of(mapper),
        accuracy: evaluation.as_ref().map(|e| Accuracy {
            ate_rmse_m: e.ate_rmse_m,
            odometry_ate_rmse_m: of_odometry.and_then(|e| e.ate_rmse_m),
            silent_m: silently_wrong.silent_m,
            coverage: e.coverage,
        }),
        counters,
        configuration: config,
        trajectory_sha256: digest::of_bytes(trajectory.to_tum().as_bytes()),
        timing: timing(&pipeline, &results.states),
        comparison: published.map(|published| Comparison::of(&published, &results.states)),
        input,
    };
    let files = results.files(&trajectory, mapper);
    let picture = results.picture(&trajectory, &report.input.name, mapper);
    let mut failed = write(out, files, picture)?;
    if let Some(first) = failed.first() {
        let lost = Count::lost(failed.len() as u64, first.clone());
        report.counters.insert("files_not_written", lost);
    }
    let mut json = serde_json::to_string_pretty(&report)?;
    json.push('\n');
    // Last: where there is a report, the rest is there, or it says what is not.
    if let Err(error) = write_whole(&out.join("report.json"), json.as_bytes()) {
        failed.push(format!("{error:#}"));
        bail!("{}", failed.join("; "));
    }
    print(&summary::text(&report, out))?;
    // Why a run ends with 3 belongs where its errors go.
    let lost = report.counters.iter().filter(|(_, c)| c.loss);
    for (name, counter) in lost.clone() {
        let what = summary::counted(name, counter);
        warn(&format!("lost: {}: {what}", report.input.name));
    }
    Ok(Some(Shown {
        ate_rmse_m: evaluation.and_then(|e| e.ate_rmse_m),
        path_m: report.path_m,
        lost: lost.count() > 0,
        same: report.comparison.as_ref().map(Comparison::same),
        timing: report.timing,
    }))
}

/// Writes as many of the files as can be written; gives why the others are missing.
fn write(
    out: &Path,
    mut files: Vec<(&'static str, Vec<u8>)>,
    picture: anyhow::Result<String>,
) -> anyhow::Result<Vec<String>> {
    std::fs::create_dir_all(out).with_context(|| format!("{}: cannot be made", out.display()))?;
    earlier::keep_results(out)?;
    let mut failed = Vec::new();
    match picture {
        // Behind all else, which can do without it.
        Ok(text) => files.push(("plot.svg", text.into_bytes())),
        Err(error) => failed.push(format!("plot.svg: {error:#}")),
    }
    for (name, bytes) in files {
        if let Err(error) = write_whole(&out.join(name), &bytes) {
            failed.push(format!("{error:#}"));
        }
    }
    Ok(failed)
}

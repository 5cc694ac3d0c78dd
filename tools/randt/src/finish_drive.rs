//! The end of a drive, for `run`, `up` and missions alike: the window is closed, the map judged as
//! a whole, and the same files, report and summary are written.

mod summary;

use crate::{
    compare::Comparison,
    digest, earlier, extents,
    final_poses::final_poses,
    loops::Loops,
    output::{json, print, warn, write_whole},
    pipeline::Pipeline,
    report::{self, Accuracy, Costs, Counters, Input, Report},
    results::{File, Results},
    trust_spans,
};
use anyhow::{Context as _, bail};
use randt_config::Config;
use randt_evaluation::silently_wrong;
use randt_messages::OdometryState;
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
    /// Everything that was dropped, repaired or assumed, beside what odometry and mapper count
    /// themselves.
    pub counters: Counters,
    /// What was published live, where the results are to be compared with that.
    pub published: Option<Vec<OdometryState>>,
}

/// The result of a computation, in figures.
#[derive(Debug)]
pub struct Shown {
    /// Error against the log's truth.
    pub ate_rmse_m: Option<f64>,
    /// Length of the path.
    pub path_m: f64,
    /// Cost per stage.
    pub timing: Costs,
    /// Whether data were lost.
    pub lost: bool,
    /// Whether every pose is the one that was published live, where that was asked.
    pub same: Option<bool>,
}

/// Ends a drive: writes all files into a folder and prints the summary; `None`, and no file, where
/// no scan has a pose. `timing` gives what it cost.
pub fn finish_drive(
    drive: Drive<'_>,
    timing: impl FnOnce(&Pipeline, &[OdometryState]) -> Costs,
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
    counters.append(report::pipeline_counters(&pipeline));
    let first = "scans that odometry computed, and whose state is nowhere";
    counters.add_lost("states_missing", results.states_missing(), first);
    let mapper = pipeline.mapper();
    let trajectory = final_poses(&results.states, mapper);
    let evaluation = results.evaluation(&trajectory);
    let odometry = results.odometry();
    let of_odometry = results.evaluation(&odometry);
    let trust_spans = trust_spans::from_states(&results.states);
    let trust = trust_spans::for_evaluation(&trust_spans);
    let silently_wrong = silently_wrong(&odometry, results.truth(), &trust);
    let mut report = Report {
        schema: report::SCHEMA.to_owned(),
        randt: randt_version::VERSION.to_owned(),
        scans: results.states.len() as u64,
        keyframes: mapper.keyframes().len() as u64,
        path_m: results.path_m(),
        frames: results.frames(),
        trust: results.trust(),
        trust_reasons: extents::by_trust_reason(&results.states),
        localizability: extents::by_localizability(&results.states),
        trust_spans: Some(trust_spans),
        loops: Some(Loops::from_mapper(mapper)),
        accuracy: evaluation.as_ref().map(|e| Accuracy {
            ate_rmse_m: e.ate_rmse_m,
            odometry_ate_rmse_m: of_odometry.and_then(|e| e.ate_rmse_m),
            silent_m: silently_wrong.silent_m,
            coverage: e.coverage,
        }),
        counters,
        configuration: Some(config.clone()),
        trajectory_sha256: digest::of_bytes(trajectory.to_tum().as_bytes()),
        timing: timing(&pipeline, &results.states),
        comparison: published.map(|published| Comparison::new(&published, &results.states)),
        input,
    };
    let mut files = results.files(&trajectory, mapper);
    let picture = results.picture(&trajectory, &report.input.name, mapper);
    // Behind all else, which can do without it.
    files.push((
        "plot.svg",
        picture.map(String::into_bytes).context("plot.svg"),
    ));
    let mut failed = write(out, files)?;
    if let Some(first) = failed.first() {
        let count = failed.len() as u64;
        report.counters.add_lost("files_not_written", count, first);
    }
    let json = json(&report)?;
    // Last: where there is a report, the rest is there, or the report names what is missing.
    if let Err(error) = write_whole(&out.join("report.json"), json.as_bytes()) {
        failed.push(format!("{error:#}"));
        bail!("{}", failed.join("; "));
    }
    print(&summary::text(&report, out))?;
    // Why a run ends with 3 belongs where its errors go.
    for (name, counter) in report.counters.by_loss(true) {
        let what = summary::counted(name, counter);
        warn(&format!("lost: {}: {what}", report.input.name));
    }
    Ok(Some(Shown {
        ate_rmse_m: evaluation.and_then(|e| e.ate_rmse_m),
        path_m: report.path_m,
        lost: report.counters.by_loss(true).count() > 0,
        same: report.comparison.as_ref().map(Comparison::same),
        timing: report.timing,
    }))
}

/// Writes as many of the files as there are and can be written; gives why the others are missing.
fn write(out: &Path, files: Vec<File>) -> anyhow::Result<Vec<String>> {
    std::fs::create_dir_all(out).with_context(|| format!("{}: cannot be made", out.display()))?;
    earlier::keep_results(out)?;
    let written = files
        .into_iter()
        .map(|(name, bytes)| write_whole(&out.join(name), &bytes?));
    Ok(written
        .filter_map(|written| Some(format!("{:#}", written.err()?)))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_named_and_the_rest_is_written() {
        let out = tempfile::tempdir().unwrap();
        std::fs::create_dir(out.path().join("keyframes.tum")).unwrap();
        let files: Vec<File> = vec![
            ("map.pgm", Err(anyhow::anyhow!("map.pgm: too wide"))),
            ("keyframes.tum", Ok(b"in the way".to_vec())),
            ("odometry.tum", Ok(b"0 1 2".to_vec())),
        ];
        let failed = write(out.path(), files).unwrap();
        assert_eq!(failed.len(), 2, "{failed:?}");
        assert_eq!(failed[0], "map.pgm: too wide");
        assert!(failed[1].contains("keyframes.tum"), "{failed:?}");
        let written = std::fs::read(out.path().join("odometry.tum")).unwrap();
        assert_eq!(written, b"0 1 2");
    }
}

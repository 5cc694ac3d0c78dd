//! The end of a computation, offline or of the pipeline's processes: the same files, the same summary.

mod summary;

use crate::{
    compare::Comparison,
    digest,
    final_poses::final_poses,
    loops::Loops,
    output::{print, write_whole},
    report::{Accuracy, Cost, Count, Input, Report},
    results::Results,
    trust_spans,
};
use randt_config::Config;
use randt_evaluation::silently_wrong;
use randt_mapper::Mapper;
use std::collections::BTreeMap;
use std::path::Path;

/// Everything that was found out.
pub struct Conclusion<'a> {
    /// What was read.
    pub input: Input,
    /// The states of every scan, and the truth.
    pub results: &'a Results,
    /// The map.
    pub mapper: &'a Mapper,
    /// Configuration in force.
    pub config: &'a Config,
    /// Everything that was dropped, repaired or assumed.
    pub counters: BTreeMap<&'static str, Count>,
    /// What it cost.
    pub timing: BTreeMap<&'static str, Cost>,
    /// How it stands to what was published live, where that was asked.
    pub comparison: Option<Comparison>,
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

impl Conclusion<'_> {
    /// Writes all files and prints the summary.
    pub fn write(self, out: &Path) -> anyhow::Result<Shown> {
        let (results, mapper) = (self.results, self.mapper);
        let trajectory = final_poses(&results.states, mapper);
        let rows = results.write(out, &self.input.name, &trajectory, mapper)?;
        let evaluation = results.evaluation(&trajectory);
        let odometry = results.odometry();
        let of_odometry = results.evaluation(&odometry);
        let trust_spans = trust_spans::of(&results.states);
        let trust = trust_spans::for_evaluation(&trust_spans);
        let silently_wrong = silently_wrong(&odometry, results.truth(), &trust);
        let report = Report {
            randt: env!("CARGO_PKG_VERSION"),
            input: self.input,
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
            counters: self.counters,
            configuration: self.config,
            trajectory_sha256: digest::of_bytes(rows.as_bytes()),
            timing: self.timing,
            comparison: self.comparison,
        };
        let mut json = serde_json::to_string_pretty(&report)?;
        json.push('\n');
        write_whole(&out.join("report.json"), json.as_bytes())?;
        print(&summary::text(&report, out))?;
        // Why a run ends with 3 belongs where its errors go.
        let lost = report.counters.iter().filter(|(_, c)| c.loss);
        for (name, counter) in lost.clone() {
            let what = summary::counted(name, counter);
            eprintln!("lost: {}: {what}", report.input.name);
        }
        Ok(Shown {
            ate_rmse_m: evaluation.and_then(|e| e.ate_rmse_m),
            path_m: report.path_m,
            lost: lost.count() > 0,
            same: report.comparison.as_ref().map(Comparison::same),
            timing: report.timing,
        })
    }
}

//! `report.json`: what was computed, from what, how fast, and all that was dropped or repaired.

use crate::{
    compare::Comparison,
    digest,
    loops::Loops,
    pipeline::{Pipeline, Timing},
    results::{FrameSpan, TrustCount},
    trust_spans,
};
use randt_config::Config;
use randt_readers::{Counter, InputInfo};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The report. Everything but `timing` is a function of input and configuration.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    /// Version and commit of the program.
    pub randt: &'static str,
    /// What was read.
    pub input: Input,
    /// Scans with a pose.
    pub scans: u64,
    /// Keyframes.
    pub keyframes: u64,
    /// Length of the path, m.
    pub path_m: f64,
    /// Odometry frames; more than one where odometry had to begin anew.
    pub frames: Vec<FrameSpan>,
    /// How far the poses can be trusted.
    pub trust: TrustCount,
    /// When that changed, in order.
    pub trust_spans: Vec<trust_spans::Span>,
    /// Loop candidates.
    pub loops: Loops,
    /// Errors against the truth, where the log has it.
    pub accuracy: Option<Accuracy>,
    /// Everything that was dropped, repaired or assumed.
    pub counters: BTreeMap<&'static str, Count>,
    /// Configuration in force.
    pub configuration: &'a Config,
    /// SHA-256 of `trajectory.tum`.
    pub trajectory_sha256: String,
    /// Cost per scan and stage, and of the whole.
    pub timing: BTreeMap<&'static str, Cost>,
    /// How it stands to what was published live, where that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

/// What was read.
#[derive(Debug, Serialize)]
pub struct Input {
    /// File's or folder's name, without its path.
    pub name: String,
    /// Recognised format.
    pub format: &'static str,
    /// SHA-256 of the file; of a folder, of its files in order of their names.
    pub sha256: String,
    /// Whether the IMU was used.
    pub imu: bool,
    /// IMU samples in the input.
    pub imu_samples: u64,
}

/// Errors against the truth.
#[derive(Debug, Serialize)]
pub struct Accuracy {
    /// Of `trajectory.tum`; see `randt eval`.
    pub ate_rmse_m: Option<f64>,
    /// Of `odometry.tum`.
    pub odometry_ate_rmse_m: Option<f64>,
    /// Metres of `odometry.tum` that were wrong under good trust; see `randt eval --trust`.
    pub silent_m: u64,
    /// See `randt eval`.
    pub coverage: f64,
}

/// One counter.
#[derive(Debug, Serialize)]
pub struct Count {
    /// How often.
    pub count: u64,
    /// Whether data were lost by it.
    pub loss: bool,
    /// The first case.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub first: String,
}

impl Count {
    /// Data that were lost, with the first case.
    pub fn lost(count: u64, first: String) -> Self {
        Self {
            count,
            loss: true,
            first,
        }
    }
}

/// What a stage cost, ms.
#[derive(Debug, Serialize)]
pub struct Cost {
    /// Number of scans.
    pub count: usize,
    /// Median.
    pub median_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Largest.
    pub max_ms: f64,
}

impl Cost {
    /// Of a list of times in ns.
    pub fn of(times_ns: &[u64]) -> Self {
        let mut sorted = times_ns.to_vec();
        sorted.sort_unstable();
        let at = |share: f64| {
            let index =
                ((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1));
            sorted.get(index).map_or(0.0, |ns| *ns as f64 * 1e-6)
        };
        Self {
            count: sorted.len(),
            median_ms: at(0.5),
            p99_ms: at(0.99),
            max_ms: at(1.0),
        }
    }
}

/// Per stage: what each scan cost.
pub fn timing(timing: &Timing, read_ns: &[u64], whole_ns: u64) -> BTreeMap<&'static str, Cost> {
    BTreeMap::from([
        ("filter", Cost::of(&timing.filter_ns)),
        ("odometry", Cost::of(&timing.odometry_ns)),
        (
            "filter_and_odometry",
            Cost::of(&timing.filter_and_odometry_ns()),
        ),
        ("mapper_per_keyframe", Cost::of(&timing.mapper_ns)),
        ("read", Cost::of(read_ns)),
        ("run", Cost::of(&[whole_ns])),
    ])
}

/// All counters of a reader that are not zero.
///
/// Texts name the input without its path, so that a report does not depend on where things lie.
pub fn of_reader(path: &Path, input: &[Counter]) -> BTreeMap<&'static str, Count> {
    let folder = path
        .parent()
        .map(|p| format!("{}/", p.display()))
        .filter(|p| p.len() > 1)
        .unwrap_or_default();
    let without_path = |text: &str| {
        if folder.is_empty() {
            text.to_owned()
        } else {
            text.replace(&folder, "")
        }
    };
    let count = |counter: &Counter| Count {
        count: counter.count,
        loss: counter.loss,
        first: without_path(&counter.first),
    };
    let counted = input.iter().filter(|counter| counter.count > 0);
    counted
        .map(|counter| (counter.name, count(counter)))
        .collect()
}

/// All counters of odometry and mapper that are not zero.
pub fn of_pipeline(pipeline: &Pipeline) -> BTreeMap<&'static str, Count> {
    let (odometry, mapper) = (pipeline.counters(), pipeline.mapper().counters());
    let counts = [
        // Whether a scan lacks its pose, or only its best one.
        ("odometry_scans_rejected", odometry.scans_rejected, true),
        ("odometry_scans_repeated", odometry.scans_repeated, true),
        (
            "odometry_scans_unsupported",
            odometry.scans_unsupported,
            false,
        ),
        ("odometry_scans_imu_late", odometry.scans_imu_late, false),
        (
            "odometry_scans_imu_overtaken",
            odometry.scans_imu_overtaken,
            false,
        ),
        (
            "odometry_scans_without_imu",
            odometry.scans_without_imu,
            false,
        ),
        ("odometry_frames_reopened", odometry.frames_reopened, false),
        ("odometry_solver_failures", odometry.solver_failures, false),
        ("odometry_imu_rejected", odometry.imu_rejected, true),
        ("odometry_imu_holes", odometry.imu_holes, true),
        ("odometry_points_outside", odometry.points_outside, false),
        ("mapper_keyframes_rejected", mapper.keyframes_rejected, true),
        ("mapper_solver_failures", mapper.solver_failures, false),
        (
            "keyframes_of_another_drive",
            pipeline.keyframes_refused(),
            true,
        ),
    ];
    let counted = counts.into_iter().filter(|(_, count, _)| *count > 0);
    let count = |name, count, loss| Count {
        count,
        loss,
        first: match name {
            "odometry_scans_imu_late" => imu_late_text(&odometry),
            _ => String::new(),
        },
    };
    counted
        .map(|(name, number, loss)| (name, count(name, number, loss)))
        .collect()
}

/// The first scan whose IMU ended before its sweep did.
fn imu_late_text(odometry: &randt_odometry::Counters) -> String {
    format!(
        "the IMU ends {:.1} ms before the sweep that ends at {} ns",
        odometry.imu_late_short_ns as f64 * 1e-6,
        odometry.imu_late_first_ns
    )
}

/// What the input says of itself, for the report.
pub fn input(info: &InputInfo, path: &Path, imu: bool, imu_samples: u64) -> anyhow::Result<Input> {
    Ok(Input {
        name: path
            .file_name()
            .unwrap_or(path.as_os_str())
            .to_string_lossy()
            .into_owned(),
        format: info.format,
        sha256: digest::of_path(path)?,
        imu,
        imu_samples,
    })
}

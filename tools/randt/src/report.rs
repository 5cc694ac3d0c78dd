//! `report.json`: what was computed, from what, how fast, and all that was dropped or repaired.

use crate::{
    compare::Comparison,
    digest,
    extents::Extents,
    loops::Loops,
    pipeline::{Pipeline, Timing},
    results::{FrameSpan, TrustCount},
    trust_spans::TrustSpan,
};
use anyhow::Context;
use randt_config::Config;
use randt_readers::{Counter, InputInfo};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// Name and version of the form of `report.json`, which docs/report.md describes. A key that is
/// added keeps the version; one that goes, or means something else, raises it.
pub const SCHEMA: &str = "randt-report/1";

/// The report, as it is written and read. Its fields are the keys of `report.json`. Everything but
/// `timing` is a function of input and configuration.
///
/// What an older report lacks is empty, or `None` where a reader must know that it is missing.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// What the file is: [`SCHEMA`].
    pub schema: String,
    /// Version and commit of the program.
    pub randt: String,
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
    /// Why they could not, by [`randt_messages::TrustReason`].
    pub trust_reasons: Extents,
    /// Which directions of the position the scans saw, by [`randt_messages::Localizability`].
    pub localizability: Extents,
    /// When that changed, in order.
    pub trust_spans: Option<Vec<TrustSpan>>,
    /// Loop candidates.
    pub loops: Option<Loops>,
    /// Errors against the truth, where the log has it.
    pub accuracy: Option<Accuracy>,
    /// Everything that was dropped, repaired or assumed.
    pub counters: Counters,
    /// Configuration in force. It is for people: what reads a report does not take it from there.
    #[serde(skip_deserializing)]
    pub configuration: Option<Config>,
    /// SHA-256 of `trajectory.tum`.
    pub trajectory_sha256: String,
    /// Cost per scan and stage, and of the whole.
    pub timing: Costs,
    /// Differences from the poses that were published live, where that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

impl Report {
    /// Reads the report of a run.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        serde_json::from_slice(&bytes)
            .with_context(|| format!("{}: no report of a run", path.display()))
    }
}

/// What was read.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Input {
    /// File's or folder's name, without its path.
    pub name: String,
    /// Recognised format.
    pub format: Cow<'static, str>,
    /// SHA-256 of the file; of a folder, of its files in order of their names.
    pub sha256: String,
    /// Whether the IMU was used.
    pub imu: bool,
    /// IMU samples in the input.
    pub imu_samples: u64,
}

/// Errors against the truth.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Accuracy {
    /// Of `trajectory.tum`; see `randt-lab eval`.
    pub ate_rmse_m: Option<f64>,
    /// Of `odometry.tum`.
    pub odometry_ate_rmse_m: Option<f64>,
    /// Metres of `odometry.tum` that were wrong under good trust; see `randt-lab eval --trust`.
    pub silent_m: u64,
    /// See `randt-lab eval`.
    pub coverage: f64,
}

/// What was dropped, repaired or assumed, by name.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Counters(BTreeMap<Cow<'static, str>, Count>);

/// One counter.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Count {
    /// How often.
    pub count: u64,
    /// Whether data were lost by it.
    pub loss: bool,
    /// The first case.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub first: String,
}

impl Counters {
    /// Adds a counter that is not zero.
    pub fn add(&mut self, name: &'static str, count: Count) {
        if count.count > 0 {
            self.0.insert(name.into(), count);
        }
    }

    /// Adds data that were lost, with the first case, unless their count is zero.
    pub fn add_lost(&mut self, name: &'static str, count: u64, first: impl Into<String>) {
        let (loss, first) = (true, first.into());
        self.add(name, Count { count, loss, first });
    }

    /// Adds those of another part of the pipeline.
    pub fn append(&mut self, mut other: Self) {
        self.0.append(&mut other.0);
    }

    /// Removes a counter that has turned out not to hold.
    pub fn remove(&mut self, name: &str) {
        self.0.remove(name);
    }

    /// Those by which data were lost, or those by which none were.
    pub fn by_loss(&self, loss: bool) -> impl Iterator<Item = (&str, &Count)> {
        let counters = self.0.iter().map(|(name, count)| (&**name, count));
        counters.filter(move |(_, count)| count.loss == loss)
    }
}

/// What a stage cost, ms.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
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

/// Costs by stage.
pub type Costs = BTreeMap<Cow<'static, str>, Cost>;

impl Cost {
    /// From a list of times in ns.
    pub fn from_times(times_ns: &[u64]) -> Self {
        let mut sorted = times_ns.to_vec();
        sorted.sort_unstable();
        let at = |share: f64| {
            let index = (sorted.len() as f64 * share) as usize;
            let time_ns = sorted.get(index).or(sorted.last());
            time_ns.map_or(0.0, |ns| *ns as f64 * 1e-6)
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
pub fn timing(timing: &Timing, read_ns: &[u64], whole_ns: u64) -> Costs {
    let both_ns = timing.filter_and_odometry_ns();
    let costs: [(&str, &[u64]); 6] = [
        ("filter", &timing.filter_ns),
        ("odometry", &timing.odometry_ns),
        ("filter_and_odometry", &both_ns),
        ("mapper_per_keyframe", &timing.mapper_ns),
        ("read", read_ns),
        ("run", &[whole_ns]),
    ];
    let costs = costs.map(|(stage, times_ns)| (stage.into(), Cost::from_times(times_ns)));
    BTreeMap::from(costs)
}

/// All counters of a reader that are not zero.
///
/// Texts name the input without its path, so that a report does not depend on where things lie.
pub fn reader_counters(path: &Path, input: &[Counter]) -> Counters {
    let folder = path.parent().map(|p| format!("{}/", p.display()));
    let folder = folder.filter(|folder| folder.len() > 1);
    let mut counters = Counters::default();
    for counter in input {
        let (count, loss, first) = (counter.count, counter.loss, &counter.first);
        let first = match &folder {
            Some(folder) => first.replace(folder, ""),
            None => first.clone(),
        };
        counters.add(counter.name, Count { count, loss, first });
    }
    counters
}

/// Counters whose text says what is wrong.
const GYRO_REFUSED: &str = "odometry_scans_gyro_refused";
const WITHOUT_GRAVITY: &str = "odometry_imu_without_gravity";
const GYRO_SHIFTED: &str = "odometry_scans_gyro_shifted";
const GYRO_CLIPS: &str = "odometry_gyro_clips";
const BIAS_CHANGES: &str = "odometry_gyro_bias_changes";
const MOUNTING_OFF: &str = "odometry_scans_mounting_off";

/// All counters of odometry and mapper that are not zero.
pub fn pipeline_counters(pipeline: &Pipeline) -> Counters {
    let (odometry, mapper) = (pipeline.counters(), pipeline.mapper().counters());
    // A scan lacks its pose ...
    let lost = [
        ("odometry_scans_rejected", odometry.scans_rejected),
        ("odometry_scans_repeated", odometry.scans_repeated),
        ("odometry_imu_rejected", odometry.imu_rejected),
        ("odometry_imu_holes", odometry.imu_holes),
        (GYRO_REFUSED, odometry.scans_gyro_refused),
        ("odometry_twists_rejected", odometry.twists_rejected),
        ("mapper_keyframes_rejected", mapper.keyframes_rejected),
        ("keyframes_of_another_drive", pipeline.keyframes_refused()),
    ];
    // ... or only its best one.
    let others = [
        ("odometry_scans_frozen", odometry.scans_frozen),
        ("odometry_scans_unsupported", odometry.scans_unsupported),
        ("odometry_scans_imu_late", odometry.scans_imu_late),
        ("odometry_scans_imu_overtaken", odometry.scans_imu_overtaken),
        ("odometry_scans_without_imu", odometry.scans_without_imu),
        (WITHOUT_GRAVITY, odometry.imu_without_gravity),
        (GYRO_SHIFTED, odometry.scans_gyro_shifted),
        (GYRO_CLIPS, odometry.gyro_clips),
        (BIAS_CHANGES, odometry.gyro_bias_changes),
        ("odometry_gyro_spikes", odometry.gyro_spikes),
        (MOUNTING_OFF, odometry.scans_mounting_off),
        ("odometry_scans_by_twist", odometry.scans_by_twist),
        ("odometry_scans_twist_refused", odometry.scans_twist_refused),
        ("odometry_frames_reopened", odometry.frames_reopened),
        ("odometry_solver_failures", odometry.solver_failures),
        ("odometry_points_outside", odometry.points_outside),
        ("mapper_solver_failures", mapper.solver_failures),
    ];
    let mut counters = Counters::default();
    for (name, count) in lost {
        let first = match name {
            GYRO_REFUSED => odometry.gyro_fault.to_string(),
            _ => String::new(),
        };
        counters.add_lost(name, count, &first);
    }
    for (name, count) in others {
        let loss = false;
        let first = match name {
            "odometry_scans_imu_late" => imu_late_text(&odometry),
            WITHOUT_GRAVITY => odometry.gravity_text(),
            GYRO_SHIFTED => odometry.shifted_text(),
            GYRO_CLIPS => odometry.clipped_text(),
            BIAS_CHANGES => odometry.bias_text(),
            MOUNTING_OFF => odometry.mounting_text(),
            "odometry_scans_twist_refused" => odometry.twist_refused_text(),
            _ => String::new(),
        };
        counters.add(name, Count { count, loss, first });
    }
    counters
}

/// The first scan whose IMU ended before its sweep did.
fn imu_late_text(odometry: &randt_odometry::Counters) -> String {
    format!(
        "the IMU ends {:.1} ms before the sweep that ends at {} ns",
        odometry.imu_late_short_ns as f64 * 1e-6,
        odometry.imu_late_first_ns
    )
}

/// The input as the report describes it.
pub fn input(info: &InputInfo, path: &Path, imu: bool, imu_samples: u64) -> anyhow::Result<Input> {
    let name = path.file_name().unwrap_or(path.as_os_str());
    Ok(Input {
        name: name.to_string_lossy().into_owned(),
        format: info.format.into(),
        sha256: digest::of_path(path)?,
        imu,
        imu_samples,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_documented() {
        let report = Report {
            accuracy: Some(Accuracy::default()),
            ..Report::default()
        };
        let text = include_str!("../../../docs/report.md");
        let report = serde_json::to_value(&report).unwrap();
        let mut keys: Vec<String> = report.as_object().unwrap().keys().cloned().collect();
        for part in ["input", "trust", "accuracy"] {
            let inside = report[part].as_object().unwrap().keys();
            keys.extend(inside.map(|key| format!("{part}.{key}")));
        }
        keys.push("comparison".to_owned());
        for key in keys {
            assert!(text.contains(&format!("`{key}`")), "{key}");
        }
        assert!(text.contains(SCHEMA));
    }

    #[test]
    fn what_is_written_is_read_and_what_an_older_report_lacks_is_empty() {
        let mut report = Report {
            randt: "0.1.0".to_owned(),
            scans: 7,
            trust_spans: Some(Vec::new()),
            accuracy: Some(Accuracy {
                ate_rmse_m: Some(0.25),
                ..Accuracy::default()
            }),
            comparison: Some(Comparison::default()),
            ..Report::default()
        };
        report.counters.add_lost("files_not_written", 2, "map.pgm");
        report.counters.add_lost("keyframes_lost", 0, "none");
        let run = Cost::from_times(&[2_000_000, 1_000_000]);
        report.timing.insert("run".into(), run);
        let json = serde_json::to_string(&report).unwrap();
        let read: Report = serde_json::from_str(&json).unwrap();
        assert_eq!(serde_json::to_string(&read).unwrap(), json);
        assert_eq!(read.counters.by_loss(true).count(), 1);
        report.configuration = Some(Config::default());
        let json = serde_json::to_string(&report).unwrap();
        assert!(json.contains(r#""configuration":{""#), "{json}");

        let older: Report = serde_json::from_str(r#"{"scans": 3, "gone": [1]}"#).unwrap();
        assert_eq!((older.scans, older.keyframes), (3, 0));
        assert!(older.trust_spans.is_none() && older.loops.is_none());
    }
}

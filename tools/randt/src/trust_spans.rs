//! When trust changed in a run: for its `report.json`, and from there for the evaluation.

use crate::report::Report;
use anyhow::Context;
use randt_messages::{ImuUse, OdometryState, Trust, TrustReason};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// Scans in a row of one trust.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrustSpan {
    /// Stamp of the first of them, ns.
    pub begin_ns: i64,
    /// How many there are.
    pub scans: u64,
    /// Their trust.
    pub trust: TrustLevel,
    /// Whether the IMU covered their sweeps.
    pub imu: bool,
    /// Why it was not good, of all of these scans.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<Cow<'static, str>>,
}

/// How far a pose can be trusted, as the report has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrustLevel {
    /// Fixed by the scan in every direction.
    Good,
    /// Held by gyro or motion model in some direction, or fitting poorly.
    Degraded,
    /// Given up.
    Lost,
}

/// The spans of these states.
pub fn from_states(states: &[OdometryState]) -> Vec<TrustSpan> {
    let alike = |a: &OdometryState, b: &OdometryState| key(a) == key(b);
    let span = |states: &[OdometryState]| {
        let first = states.first()?;
        let (trust, imu) = key(first);
        let all = states
            .iter()
            .fold(0, |all, state| all | state.trust_reasons);
        let reasons = TrustReason::in_set(all).map(|reason| reason.as_str().into());
        Some(TrustSpan {
            begin_ns: first.header.stamp_ns,
            scans: states.len() as u64,
            trust,
            imu,
            reasons: reasons.collect(),
        })
    };
    states.chunk_by(alike).filter_map(span).collect()
}

fn key(state: &OdometryState) -> (TrustLevel, bool) {
    let trust = match state.trust() {
        Trust::Good => TrustLevel::Good,
        Trust::Degraded => TrustLevel::Degraded,
        Trust::Lost => TrustLevel::Lost,
    };
    (trust, state.imu_use == ImuUse::Covered as u32)
}

/// The same for the evaluation.
pub fn for_evaluation(spans: &[TrustSpan]) -> Vec<randt_evaluation::TrustSpan> {
    let span = |span: &TrustSpan| randt_evaluation::TrustSpan {
        begin_ns: span.begin_ns,
        good: span.trust == TrustLevel::Good,
        imu: span.imu,
    };
    spans.iter().map(span).collect()
}

/// Reads the spans of a report.
pub fn read(path: &Path) -> anyhow::Result<Vec<randt_evaluation::TrustSpan>> {
    let spans = Report::read(path)?.trust_spans;
    let spans = spans.context("missing field `trust_spans`");
    let spans = spans.with_context(|| {
        let file = path.display();
        format!("{file}: no report of a run with its changes of trust")
    })?;
    Ok(for_evaluation(&spans))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(stamp_ns: i64, trust: Trust, imu_use: ImuUse) -> OdometryState {
        let mut state = OdometryState::default();
        state.header.stamp_ns = stamp_ns;
        state.trust = trust as u32;
        state.imu_use = imu_use as u32;
        state
    }

    #[test]
    fn a_report_keeps_when_trust_changed() {
        let states = [
            OdometryState {
                trust_reasons: TrustReason::Weak as u32 | TrustReason::Fit as u32,
                ..state(1, Trust::Degraded, ImuUse::Covered)
            },
            state(2, Trust::Good, ImuUse::Covered),
            state(3, Trust::Good, ImuUse::Covered),
            state(4, Trust::Good, ImuUse::Late),
            state(5, Trust::Lost, ImuUse::None),
        ];
        let spans = from_states(&states);
        let json = serde_json::json!({"scans": 5, "trust_spans": spans}).to_string();
        assert!(
            json.contains(r#"{"begin_ns":2,"imu":true,"scans":2,"trust":"good"}"#),
            "{json}"
        );
        assert!(json.contains(r#""reasons":["weak","fit"]"#), "{json}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        std::fs::write(&path, &json).unwrap();
        let read = read(&path).unwrap();
        let short: Vec<_> = read.iter().map(|s| (s.begin_ns, s.good, s.imu)).collect();
        let expected = [
            (1, false, true),
            (2, true, true),
            (4, true, false),
            (5, false, false),
        ];
        assert_eq!(short, expected);

        std::fs::write(&path, r#"{"scans": 5}"#).unwrap();
        let text = format!("{:#}", super::read(&path).unwrap_err());
        assert!(text.contains("missing field `trust_spans`"), "{text}");
    }
}

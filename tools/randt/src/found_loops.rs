//! The loops that a run has found, out of its mapper or its `report.json`.

use crate::report::Report;
use anyhow::Context;
use randt_evaluation::LoopEdge;
use randt_geometry::Pose2;
use randt_mapper::{KeyframeIdx, LoopClosure, Mapper};
use std::path::Path;

/// The statuses of a candidate that is in the graph, or confirms it without news.
const FOUND: [&str; 2] = ["accepted", "confirmed"];

/// The loops in a mapper's graph and those that confirm it, in the order in which they were found.
pub fn from_mapper(mapper: &Mapper) -> Vec<LoopEdge> {
    let keyframe = |index: KeyframeIdx| mapper.keyframes().get(index.0);
    let edge = |closure: &LoopClosure| {
        Some(LoopEdge {
            from_ns: keyframe(closure.older)?.stamp_ns,
            to_ns: keyframe(closure.newer)?.stamp_ns,
            relative: closure.older_from_newer,
        })
    };
    mapper.found().filter_map(edge).collect()
}

/// Reads the loops of a report that were found, in its order.
pub fn read(path: &Path) -> anyhow::Result<Vec<LoopEdge>> {
    let why = "no report of a run that says what became of its loops";
    found(Report::read(path)?).with_context(|| format!("{}: {why}", path.display()))
}

fn found(report: Report) -> anyhow::Result<Vec<LoopEdge>> {
    let loops = report.loops.context("missing field `loops`")?;
    let candidates = loops.candidates.into_iter();
    let found = candidates.filter(|candidate| FOUND.contains(&&*candidate.status));
    let edges = found.map(|candidate| LoopEdge {
        from_ns: candidate.from_ns,
        to_ns: candidate.to_ns,
        relative: Pose2::from_array(candidate.relative),
    });
    Ok(edges.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(json: &[u8]) -> anyhow::Result<Vec<LoopEdge>> {
        found(serde_json::from_slice(json)?)
    }

    #[test]
    fn only_what_was_found_counts_and_other_fields_do_not_matter() {
        let json = br#"{"randt": "0.1.0", "loops": {"enabled": true, "candidates": [
            {"from_ns": 1, "to_ns": 2, "relative": [1, 2.5, -0.5], "status": "accepted", "score": 3.1},
            {"from_ns": 2, "to_ns": 5, "relative": [1, 0, 0], "status": "confirmed"},
            {"from_ns": 3, "to_ns": 4, "relative": [0, 0, 0], "status": "inconsistent"}]}}"#;
        let loops = parse(json).unwrap();
        assert_eq!(loops.len(), 2);
        assert_eq!((loops[0].from_ns, loops[0].to_ns), (1, 2));
        assert_eq!(loops[0].relative.to_array(), [1.0, 2.5, -0.5]);
    }

    #[test]
    fn a_report_of_an_earlier_build_is_read() {
        let json = br#"{"loops": {"fates": {"accepted": 1}, "parts": 1, "candidates": [
            {"from_ns": 1, "to_ns": 2, "relative": [1, 2, 0], "fate": "accepted", "source": "estimate"}]}}"#;
        assert_eq!(parse(json).unwrap().len(), 1);
    }

    #[test]
    fn what_is_missing_is_named() {
        for (json, words) in [
            ("{}", "missing field `loops`"),
            (r#"{"loops": {}}"#, "missing field `candidates`"),
            (
                r#"{"loops": {"candidates": [{"from_ns": 1.5}]}}"#,
                "invalid type: floating point `1.5`, expected i64",
            ),
            (
                r#"{"loops": {"candidates": [{"from_ns": 1, "to_ns": 2, "relative": [1, 2]}]}}"#,
                "invalid length 2, expected an array of length 3",
            ),
            ("# stamp x y z", "expected value at line 1"),
        ] {
            let text = parse(json.as_bytes()).unwrap_err().to_string();
            assert!(text.contains(words), "{text}");
        }
    }
}

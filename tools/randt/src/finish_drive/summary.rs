//! What `randt run` prints at its end.

use crate::{
    extents::Extents,
    report::{Count, Report},
};
use std::fmt::Write;
use std::path::Path;

/// A counter with its first case.
pub fn counted(name: &str, counter: &Count) -> String {
    let Count { count, first, .. } = counter;
    match first.as_str() {
        "" => format!("{name} {count}"),
        first => format!("{name} {count} (first: {first})"),
    }
}

/// Why trust was not good and for how long; nothing of single scans, such as the first one.
fn doubted(reasons: &Extents) -> String {
    let mut text = String::new();
    let longer = reasons.iter().filter(|(_, extent)| extent.seconds > 0.0);
    for ((reason, extent), before) in longer.zip([" ("].into_iter().chain(std::iter::repeat("; ")))
    {
        let (seconds, path_m) = (extent.seconds, extent.path_m);
        let _ = write!(text, "{before}{reason} {seconds:.1} s, {path_m:.1} m");
    }
    if !text.is_empty() {
        text.push(')');
    }
    text
}

/// The summary of a run, as it is printed.
pub fn text(report: &Report, out: &Path) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let frames = report.frames.iter();
    let seconds: f64 = frames.map(|f| (f.end_ns - f.begin_ns) as f64 * 1e-9).sum();
    let _ = writeln!(
        text,
        "{} ({}): {} scans, {seconds:.1} s, {:.1} m driven",
        report.input.name, report.input.format, report.scans, report.path_m
    );
    let live = report.accuracy.as_ref().and_then(|a| a.odometry_ate_rmse_m);
    let live = live.map_or(String::new(), |m| format!("; odometry's, live, {m:.3} m"));
    let silent_m = report.accuracy.as_ref().map(|a| a.silent_m);
    let silent = match silent_m {
        None | Some(0) => String::new(),
        Some(silent_m) => format!("; {silent_m} m of it were wrong under good trust"),
    };
    if let Some(ate_m) = report.accuracy.as_ref().and_then(|a| a.ate_rmse_m) {
        let _ = writeln!(
            text,
            "accuracy: ATE {ate_m:.3} m against the log's truth{live}{silent}"
        );
    }
    if let Some(comparison) = &report.comparison {
        let _ = writeln!(text, "compared: {comparison}");
    }
    let loops = report.loops.as_ref();
    let components = loops.map_or(1, |loops| loops.components);
    if report.frames.len() > 1 {
        let frames = report.frames.len();
        let _ = match components {
            1 => writeln!(text, "{frames} odometry frames, merged by verified loops"),
            components => writeln!(
                text,
                "{frames} odometry frames in {components} components of the map, each with its own origin: no loop connects them"
            ),
        };
    }
    let configuration = report.configuration.as_ref();
    if configuration.is_some_and(|it| it.loops.enabled) {
        let candidates = loops.map_or(0, |loops| loops.candidates.len());
        let count = |status| loops.and_then(|loops| loops.statuses.get(status).copied());
        let [closed, confirmed] = ["accepted", "confirmed"].map(|it| count(it).unwrap_or(0));
        let _ = writeln!(
            text,
            "loops: {closed} closed and {confirmed} without news, of {candidates} candidates"
        );
    }
    let trust = &report.trust;
    let (good, degraded, lost) = (trust.good, trust.degraded, trust.lost);
    let reasons = doubted(&report.trust_reasons);
    let _ = writeln!(
        text,
        "trust: {good} good, {degraded} degraded, {lost} lost{reasons}"
    );
    let cost = report.timing.get("filter_and_odometry");
    if let Some((cost, whole)) = cost.zip(report.timing.get("run")) {
        let _ = writeln!(
            text,
            "per scan: median {:.2} ms, p99 {:.2} ms; whole run {:.1} s",
            cost.median_ms,
            cost.p99_ms,
            whole.median_ms * 1e-3
        );
    }
    if let Some(cost) = report.timing.get("compute") {
        let _ = writeln!(
            text,
            "latency: from scan and IMU on the bus to the pose median {:.2} ms, p99 {:.2} ms",
            cost.median_ms, cost.p99_ms
        );
    }
    for (name, counter) in report.counters.by_loss(false) {
        let _ = writeln!(text, "note: {}", counted(name, counter));
    }
    let _ = writeln!(
        text,
        "written to {}: odometry.csv, odometry.tum, trajectory.tum, keyframes.tum, map.pgm, map.yaml, map.png, plot.svg, report.json",
        out.display()
    );
    text
}

//! What every benchmark says of itself: the machine, and how long something took.
#![allow(dead_code, reason = "not every benchmark says all of it")]

use std::time::Duration;

/// Processors and their model; `0 x unknown` where the system does not say.
pub fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let models: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("model name"))
        .collect();
    let model = models
        .first()
        .map_or("unknown", |m| m.trim_start_matches([' ', '\t', ':']));
    format!("{} x {model}", models.len())
}

/// A line: how often, median, 99th percentile, largest, and what is allowed.
pub fn print(what: &str, mut times: Vec<Duration>, allowed_ms: Option<f64>) {
    times.sort_unstable();
    let at = |percent: usize| {
        let index = (times.len() * percent / 100).min(times.len().saturating_sub(1));
        times
            .get(index)
            .map_or(f64::NAN, |time| milliseconds(*time))
    };
    let allowed = allowed_ms.map_or(String::new(), |ms| format!(" (at most {ms})"));
    println!(
        "{what:42} {:4} runs: median {:.3} ms, p99 {:.3} ms, max {:.3} ms{allowed}",
        times.len(),
        at(50),
        at(99),
        at(100)
    );
}

pub fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

//! What the figures were measured on: without it a time means nothing.

use std::fs;

/// Processors and their model; `0 x unknown` where the system does not list it.
pub fn description() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let models: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("model name"))
        .collect();
    let model = models
        .first()
        .map_or("unknown", |m| m.trim_start_matches([' ', '\t', ':']));
    format!("{} x {model}", models.len())
}

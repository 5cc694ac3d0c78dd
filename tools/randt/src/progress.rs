//! The progress bar; it shows itself on terminals only.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `total` units, or a spinner where their number is not known beforehand.
pub fn bar(total: Option<u64>, unit: &str) -> ProgressBar {
    let (bar, template) = match total {
        Some(total) => (
            ProgressBar::new(total),
            "{wide_bar} {pos}/{len} UNIT, {eta} left",
        ),
        None => (
            ProgressBar::new_spinner(),
            "{spinner} {pos} UNIT, {elapsed}",
        ),
    };
    // A template that indicatif refuses leaves its own style.
    match ProgressStyle::with_template(&template.replace("UNIT", unit)) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

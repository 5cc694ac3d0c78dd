//! The messages of each topic over time: how many a second, the longest pause, and what is
//! missing.

use super::charts::{Panels, line};
use super::recording::Recording;
use crate::units::count;
use randt_evaluation::{Band, Colour, Panel};
use randt_messages::{LogDrop, health::text_of};

/// A rate is counted over this long, s, ...
const BIN_S: f64 = 1.0;
/// ... or over the span that makes this number of them in a long log, ...
const BINS_MAX: f64 = 500.0;
/// ... or, of a topic that is slower, over this number of messages.
const BIN_MESSAGES: f64 = 5.0;

/// How many messages a second each topic had, the longest pause, and what was not recorded.
pub fn panels(recording: &Recording) -> Panels {
    let dropped = recording.drops.iter().map(|drop| text_of(&drop.topic));
    let mut names: Vec<&str> = recording.topics.keys().map(String::as_str).collect();
    names.extend(dropped);
    // In the order of the data's way.
    let order = randt_log::channels();
    let index = |name: &str| order.iter().position(|channel| channel.topic == name);
    names.sort_by_key(|name| (index(name).unwrap_or(usize::MAX), *name));
    names.dedup();
    let panels = names.into_iter().map(|name| topic(recording, name));
    Ok(panels.collect())
}

fn topic(recording: &Recording, name: &str) -> Panel {
    let times = recording.topics.get(name).into_iter().flatten();
    let mut times: Vec<f64> = times.map(|at_ns| recording.after_s(*at_ns)).collect();
    times.sort_by(f64::total_cmp);
    let of_topic = |drop: &&LogDrop| text_of(&drop.topic) == name;
    let drops: Vec<_> = recording.drops.iter().filter(of_topic).collect();
    let bands = drops.iter().map(|drop| Band {
        name: "not recorded",
        colour: Colour::Bad,
        span_s: [drop.begin_ns, drop.end_ns].map(|at_ns| recording.after_s(at_ns)),
    });
    let pauses = times.iter().zip(times.iter().skip(1)).map(|(a, b)| b - a);
    let longest_s = pauses.fold(0.0, f64::max);
    let messages = count(times.len() as u64, "message", "messages");
    let mut label = format!("{name}, Hz: {messages}");
    if times.len() > 1 {
        label += &format!(", longest pause {longest_s:.3} s");
    }
    let missing: u64 = drops.iter().map(|drop| drop.count).sum();
    if missing > 0 {
        label += &format!(", {missing} not recorded");
    }
    Panel {
        label,
        lines: vec![line("", Colour::Second, rates(&times, recording.span_s()))],
        bands: bands.collect(),
        at_least: Some([0.0, 0.0]),
        is_low: true,
        ..Panel::default()
    }
}

/// Messages a second, in whole bins from the log's beginning; a step for each.
fn rates(times: &[f64], span_s: f64) -> Vec<[f64; 2]> {
    if times.is_empty() || span_s <= 0.0 {
        return Vec::new();
    }
    let mean_s = span_s / times.len() as f64;
    let bin_s = BIN_S.max(span_s / BINS_MAX).max(BIN_MESSAGES * mean_s);
    let bins = (span_s / bin_s).floor().max(1.0);
    // The last one is not cut short: it would show a rate that was not.
    let bin_s = span_s / bins;
    let mut counts = vec![0_u32; bins as usize];
    for time_s in times {
        let bin = ((time_s / bin_s) as usize).min(counts.len() - 1);
        if let Some(count) = counts.get_mut(bin) {
            *count += 1;
        }
    }
    let steps = (0_u32..).zip(counts).flat_map(|(bin, count)| {
        let rate_hz = f64::from(count) / bin_s;
        // One ends exactly where the next begins, or the line would be broken there.
        [bin, bin + 1].map(|edge| [f64::from(edge) * bin_s, rate_hz])
    });
    steps.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_counted_in_bins_that_fill_the_log() {
        let times: Vec<f64> = (0..100).map(|n| f64::from(n) * 0.2).collect();
        let steps = rates(&times, 19.8);
        assert_eq!(steps.first().map(|step| step[0]), Some(0.0));
        assert!((steps[steps.len() - 1][0] - 19.8).abs() < 1e-9);
        for [_, rate_hz] in steps {
            assert!((rate_hz - 5.0).abs() < 1.1, "{rate_hz}");
        }
        // One in ten seconds is no swing between 0 and 1 a second.
        let slow: Vec<f64> = (0..30).map(|n| f64::from(n) * 10.0).collect();
        assert!(rates(&slow, 290.0).iter().all(|step| step[1] < 0.2));
        assert!(rates(&[], 9.0).is_empty() && rates(&[0.0], 0.0).is_empty());
    }
}

//! Whether a radar's sweeps come, and whether they are all its own. Pure.

use crate::{Streams, Sweep};
use randt_device::{Interruptions, Link};

/// A warning of two senders stays for this time after the last contested sweep, ns: it can be seen
/// without watching all the time, and another sender that sends now and then makes no line of the
/// journal each time.
const WARNED_NS: i64 = 5_000_000_000;

/// Beams without a sweep for this many turns are no radar's.
const PATIENCE_TURNS: i64 = 3;
/// A turn takes at most this time, ns: the limit of `sensor.period_s`.
const TURN_MAX_NS: i64 = 10_000_000_000;

/// Watches the sweeps, beside the link that the source gives for its beams.
#[derive(Debug, Default)]
pub(crate) struct SweepMonitor {
    /// What the configuration allows, and what holds: more for a radar that turns more slowly than
    /// configured.
    least_ns: i64,
    pub patience_ns: i64,
    /// The radar's link.
    pub link: Link,
    /// How often sweeps stopped coming.
    pub interruptions: Interruptions,
    /// The last beam, ns.
    beam_ns: i64,
    /// The last sweep, or since when beams come without one.
    since_ns: Option<i64>,
    /// A sweep is overdue, but so is a beam: that is the source's to report.
    waits: bool,
    /// Whether a sweep came since beams do.
    has_sweep: bool,
    fruitless: bool,
    contested_ns: Option<i64>,
}

impl SweepMonitor {
    /// Watches a radar that is silent after `silence_ns`, and whose turn should take `turn_ns`.
    pub fn new(silence_ns: i64, turn_ns: i64) -> Self {
        let patience_ns = silence_ns.max(PATIENCE_TURNS * turn_ns);
        Self {
            least_ns: patience_ns,
            patience_ns,
            ..Self::default()
        }
    }

    /// A beam came.
    pub fn take_beam(&mut self, now_ns: i64) {
        self.beam_ns = now_ns;
    }

    /// A sweep came.
    pub fn take_sweep(&mut self, sweep: &Sweep, now_ns: i64) {
        self.since_ns = Some(now_ns);
        (self.has_sweep, self.fruitless) = (true, false);
        let (begin_ns, end_ns) = sweep.span_ns();
        let turn_ns = end_ns.saturating_sub(begin_ns).clamp(0, TURN_MAX_NS);
        self.patience_ns = self.least_ns.max(PATIENCE_TURNS * turn_ns);
        if sweep.is_contested() {
            self.contested_ns = Some(now_ns);
        }
    }

    /// Judges anew; `beams` is the source's link. Gives whether beams have just been without a
    /// sweep for too long.
    pub fn judge(&mut self, now_ns: i64, beams: &Link, streams: &Streams) -> bool {
        let mut is_overdue_now = false;
        if !beams.streams() {
            (self.since_ns, self.has_sweep, self.fruitless) = (None, false, false);
            self.link.clone_from(beams);
        } else {
            let since_ns = *self.since_ns.get_or_insert(now_ns);
            let is_warned = self
                .contested_ns
                .is_some_and(|at_ns| now_ns.saturating_sub(at_ns) < WARNED_NS);
            let is_overdue = now_ns.saturating_sub(since_ns) > self.patience_ns;
            let is_beam_recent = now_ns.saturating_sub(self.beam_ns) <= self.patience_ns / 2;
            self.waits = is_overdue && !is_beam_recent;
            if is_overdue && is_beam_recent {
                is_overdue_now = true;
                self.since_ns = Some(now_ns);
                if !self.fruitless {
                    self.fruitless = true;
                    self.link = Link::Down(self.no_sweep(streams));
                }
                // It may turn so slowly that beginning anew is what keeps its sweep from being
                // whole.
                let longest_ns = self.least_ns.max(PATIENCE_TURNS * TURN_MAX_NS);
                self.patience_ns = (2 * self.patience_ns).min(longest_ns);
            } else if self.fruitless {
                // It is reported already.
            } else if !self.has_sweep {
                // A link that is down is up again when a sweep comes, not when beams do.
                if !matches!(self.link, Link::Down(_)) {
                    self.link = Link::Starting;
                }
            } else if !is_warned {
                self.contested_ns = None;
                self.link.clone_from(beams);
            } else if !matches!(&self.link, Link::Warning(text) if text.starts_with(TWO_SENDERS)) {
                self.link = Link::Warning(two_senders(streams));
            }
        }
        self.interruptions.update(&self.link);
        is_overdue_now
    }

    /// When to judge although nothing came, ns.
    pub fn due_ns(&self) -> i64 {
        match self.since_ns {
            Some(since_ns) if !self.waits => since_ns.saturating_add(self.patience_ns + 1),
            _ => i64::MAX,
        }
    }

    fn no_sweep(&self, streams: &Streams) -> String {
        let patience_s = self.patience_ns as f64 * 1e-9;
        match streams.candidate().or(streams.taken()) {
            Some(sender) if sender.address.is_some() => {
                format!("beams of {sender}, but no whole sweep for more than {patience_s} s")
            }
            _ => format!("beams, but no whole sweep for more than {patience_s} s"),
        }
    }
}

/// What a warning begins with where sweeps are contested.
const TWO_SENDERS: &str = "sweeps of two senders";

fn two_senders(streams: &Streams) -> String {
    let taken = streams.taken().unwrap_or_default();
    let text = match streams.other_sender() {
        Some(other_sender) => taken.difference(&other_sender),
        None => taken.difference(&taken),
    };
    format!("{TWO_SENDERS}, {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// Beams come all along, polled a hundred times a second; gives when the source was to
    /// reconnect, in tenths of a second.
    fn reconnects(monitor: &mut SweepMonitor, seconds: i64) -> Vec<i64> {
        let streams = Streams::new(SECOND_NS / 5, SECOND_NS);
        (0..seconds * 100)
            .map(|at| at * SECOND_NS / 100)
            .filter(|now_ns| {
                monitor.take_beam(*now_ns);
                monitor.judge(*now_ns, &Link::Streaming, &streams)
            })
            .map(|now_ns| now_ns * 10 / SECOND_NS)
            .collect()
    }

    #[test]
    fn beams_without_sweeps_are_reported_with_growing_patience() {
        let mut monitor = SweepMonitor::new(SECOND_NS, SECOND_NS / 5);
        let streams = Streams::new(SECOND_NS / 5, SECOND_NS);
        monitor.judge(0, &Link::Streaming, &streams);
        assert_eq!(monitor.link, Link::Starting);
        assert_eq!(reconnects(&mut monitor, 40), [10, 30, 70, 150, 310]);
        let text = monitor.link.text();
        assert!(text.contains("no whole sweep for more than 1 s"), "{text}");
        // Without beams the source reports.
        assert!(!monitor.judge(400 * SECOND_NS, &Link::Streaming, &streams));
        assert_eq!(monitor.due_ns(), i64::MAX);
        // A sweep is what ends it.
        monitor.judge(401 * SECOND_NS, &Link::Streaming, &streams);
        assert!(!monitor.link.streams());
        monitor.take_sweep(&Sweep::default(), 402 * SECOND_NS);
        monitor.judge(402 * SECOND_NS, &Link::Streaming, &streams);
        assert_eq!(monitor.link, Link::Streaming);
        assert_eq!(monitor.patience_ns, SECOND_NS);
        monitor.judge(403 * SECOND_NS, &Link::Down("gone".to_owned()), &streams);
        monitor.judge(404 * SECOND_NS, &Link::Streaming, &streams);
        assert_eq!(monitor.link.text(), "gone", "until a sweep comes");
        assert_eq!(monitor.interruptions.count().value, 1);
    }
}

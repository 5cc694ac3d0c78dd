//! How a radar is: whether its sweeps come, and whether they are all its own. Pure.

use crate::{Streams, Sweep};
use randt_device::{Count, Interruptions, Link};

/// A warning of two senders stays for so long after the last contested sweep, ns: whoever looks once in a while sees it,
/// and a stranger that sends now and then makes no line of the journal each time.
const WARNED_NS: i64 = 5_000_000_000;

/// Beams without a sweep for so many turns are no radar's.
const PATIENCE_TURNS: i64 = 3;
/// A turn is believed to take at most so long, ns: what `sensor.period_s` may be.
const TURN_MAX_NS: i64 = 10_000_000_000;

/// Sweeps as they come, beside what the source says of its beams.
#[derive(Debug, Default)]
pub(crate) struct Condition {
    /// What the configuration allows, and what holds: more for a radar that turns more slowly than it says.
    least_ns: i64,
    patience_ns: i64,
    link: Link,
    interruptions: Interruptions,
    /// The last beam, ns.
    beam_ns: i64,
    /// The last sweep, or since when beams come without one.
    since_ns: Option<i64>,
    /// A sweep is overdue, but so is a beam: that is the source's to say.
    waits: bool,
    /// Whether a sweep came since beams do.
    came: bool,
    fruitless: bool,
    contested_ns: Option<i64>,
}

impl Condition {
    /// Of a radar that is silent after `silence_ns`, and whose turn should take `turn_ns`.
    pub fn new(silence_ns: i64, turn_ns: i64) -> Self {
        let patience_ns = silence_ns.max(PATIENCE_TURNS * turn_ns);
        Self {
            least_ns: patience_ns,
            patience_ns,
            ..Self::default()
        }
    }

    /// Beams without a sweep for so long are no radar.
    pub fn patience_ns(&self) -> i64 {
        self.patience_ns
    }

    /// A beam came.
    pub fn heard(&mut self, now_ns: i64) {
        self.beam_ns = now_ns;
    }

    /// A sweep came.
    pub fn came(&mut self, sweep: &Sweep, now_ns: i64) {
        self.since_ns = Some(now_ns);
        (self.came, self.fruitless) = (true, false);
        let (begin_ns, end_ns) = sweep.span_ns();
        let turn_ns = end_ns.saturating_sub(begin_ns).clamp(0, TURN_MAX_NS);
        self.patience_ns = self.least_ns.max(PATIENCE_TURNS * turn_ns);
        if sweep.is_contested() {
            self.contested_ns = Some(now_ns);
        }
    }

    /// Judges anew; `beams` is what the source says. Gives whether beams have just been without a sweep for too long.
    pub fn judge(&mut self, now_ns: i64, beams: &Link, streams: &Streams) -> bool {
        let mut is_news = false;
        if !beams.streams() {
            (self.since_ns, self.came, self.fruitless) = (None, false, false);
            self.set(beams);
        } else {
            let since_ns = *self.since_ns.get_or_insert(now_ns);
            let is_warned = self
                .contested_ns
                .is_some_and(|at_ns| now_ns.saturating_sub(at_ns) < WARNED_NS);
            let is_overdue = now_ns.saturating_sub(since_ns) > self.patience_ns;
            let is_heard = now_ns.saturating_sub(self.beam_ns) <= self.patience_ns / 2;
            self.waits = is_overdue && !is_heard;
            if is_overdue && is_heard {
                is_news = true;
                self.since_ns = Some(now_ns);
                if !self.fruitless {
                    self.fruitless = true;
                    self.link = Link::Trouble(self.no_sweep(streams));
                }
                // It may turn so slowly that beginning anew is what keeps its sweep from being whole.
                let longest_ns = self.least_ns.max(PATIENCE_TURNS * TURN_MAX_NS);
                self.patience_ns = (2 * self.patience_ns).min(longest_ns);
            } else if self.fruitless {
                // It has been said.
            } else if !self.came {
                // Trouble is over when a sweep comes, not when beams do.
                if !matches!(self.link, Link::Trouble(_)) {
                    self.link = Link::Starting;
                }
            } else if !is_warned {
                self.contested_ns = None;
                self.set(beams);
            } else if !matches!(&self.link, Link::Warning(text) if text.starts_with(TWO_SENDERS)) {
                self.link = Link::Warning(two_senders(streams));
            }
        }
        self.interruptions.see(&self.link);
        is_news
    }

    /// When to judge although nothing came, ns.
    pub fn due_ns(&self) -> i64 {
        match self.since_ns {
            Some(since_ns) if !self.waits => since_ns.saturating_add(self.patience_ns + 1),
            _ => i64::MAX,
        }
    }

    /// What was found.
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// How often sweeps stopped coming.
    pub fn count(&self) -> Count {
        self.interruptions.count()
    }

    fn set(&mut self, link: &Link) {
        if self.link != *link {
            self.link = link.clone();
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
    let told = match streams.stranger() {
        Some(stranger) => taken.unlike(&stranger),
        None => taken.unlike(&taken),
    };
    format!("{TWO_SENDERS}, {told}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// Beams come all along, polled a hundred times a second; gives when it was to begin anew, in tenths of a second.
    fn anew(condition: &mut Condition, seconds: i64) -> Vec<i64> {
        let streams = Streams::new(SECOND_NS / 5, SECOND_NS);
        (0..seconds * 100)
            .map(|at| at * SECOND_NS / 100)
            .filter(|now_ns| {
                condition.heard(*now_ns);
                condition.judge(*now_ns, &Link::Streaming, &streams)
            })
            .map(|now_ns| now_ns * 10 / SECOND_NS)
            .collect()
    }

    #[test]
    fn beams_without_sweeps_are_trouble_ever_more_patiently() {
        let mut condition = Condition::new(SECOND_NS, SECOND_NS / 5);
        let streams = Streams::new(SECOND_NS / 5, SECOND_NS);
        condition.judge(0, &Link::Streaming, &streams);
        assert_eq!(*condition.link(), Link::Starting);
        assert_eq!(anew(&mut condition, 40), [10, 30, 70, 150, 310]);
        let told = condition.link().text();
        assert!(told.contains("no whole sweep for more than 1 s"), "{told}");
        // Without beams it is the source that has something to say.
        assert!(!condition.judge(400 * SECOND_NS, &Link::Streaming, &streams));
        assert_eq!(condition.due_ns(), i64::MAX);
        // A sweep is what ends it.
        condition.judge(401 * SECOND_NS, &Link::Streaming, &streams);
        assert!(!condition.link().streams());
        condition.came(&Sweep::default(), 402 * SECOND_NS);
        condition.judge(402 * SECOND_NS, &Link::Streaming, &streams);
        assert_eq!(*condition.link(), Link::Streaming);
        assert_eq!(condition.patience_ns(), SECOND_NS);
        condition.judge(403 * SECOND_NS, &Link::Trouble("gone".to_owned()), &streams);
        condition.judge(404 * SECOND_NS, &Link::Streaming, &streams);
        assert_eq!(condition.link().text(), "gone", "until a sweep comes");
        assert_eq!(condition.count().value, 1);
    }
}

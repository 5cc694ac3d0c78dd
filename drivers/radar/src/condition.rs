//! How a radar is: whether its sweeps come, and whether they are all its own. Pure.

use crate::{Streams, Sweep};
use randt_device::{Count, Interruptions, Link};

/// A warning of two senders stays for so long after the last contested sweep, ns: whoever looks once in a while sees it,
/// and a stranger that sends now and then makes no line of the journal each time.
const WARNED_NS: i64 = 5_000_000_000;

/// Sweeps as they come, beside what the source says of its beams.
#[derive(Debug, Default)]
pub(crate) struct Condition {
    patience_ns: i64,
    link: Link,
    interruptions: Interruptions,
    /// The last sweep, or since when beams come without one.
    since_ns: Option<i64>,
    /// Whether a sweep came since beams do.
    came: bool,
    fruitless: bool,
    contested_ns: Option<i64>,
}

impl Condition {
    /// Beams without a sweep for so long are no radar.
    pub fn new(patience_ns: i64) -> Self {
        Self {
            patience_ns,
            ..Self::default()
        }
    }

    /// A sweep came.
    pub fn came(&mut self, sweep: &Sweep, now_ns: i64) {
        self.since_ns = Some(now_ns);
        (self.came, self.fruitless) = (true, false);
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
            if now_ns.saturating_sub(since_ns) > self.patience_ns {
                is_news = true;
                self.since_ns = Some(now_ns);
                if !self.fruitless {
                    self.fruitless = true;
                    self.link = Link::Trouble(self.no_sweep(streams));
                }
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
        let due_ns = |since_ns: i64| since_ns.saturating_add(self.patience_ns + 1);
        self.since_ns.map_or(i64::MAX, due_ns)
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

//! How often a device that is not there is tried.

/// The first pause, ns: a plug that wobbles is back at once.
const FIRST_NS: i64 = 100_000_000;
/// The longest pause, ns: back within a second after the device is, and nothing to speak of for
/// the processor.
const LONGEST_NS: i64 = 800_000_000;

/// Pauses that double from failure to failure: 0.1 s, 0.2 s, 0.4 s, 0.8 s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backoff {
    pause_ns: i64,
    due_ns: i64,
}

impl Default for Backoff {
    fn default() -> Self {
        Self {
            pause_ns: FIRST_NS,
            due_ns: i64::MIN,
        }
    }
}

impl Backoff {
    /// When the next attempt is due; at once where none has failed.
    pub fn due_ns(&self) -> i64 {
        self.due_ns
    }

    /// Whether an attempt is due.
    pub fn is_due(&self, now_ns: i64) -> bool {
        now_ns >= self.due_ns
    }

    /// An attempt has failed, or what was open is gone.
    pub fn failed(&mut self, now_ns: i64) {
        self.due_ns = now_ns.saturating_add(self.pause_ns);
        self.pause_ns = (2 * self.pause_ns).min(LONGEST_NS);
    }

    /// The device sends: the next failure is the first one again. Not for a mere success in
    /// opening it, since some open and fail at once, without end.
    pub fn succeeded(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_begin_anew_after_a_success() {
        let mut backoff = Backoff::default();
        assert!(backoff.is_due(0));
        let mut pauses = Vec::new();
        for _ in 0..7 {
            backoff.failed(1_000);
            pauses.push((backoff.due_ns() - 1_000) / 100_000_000);
            assert!(!backoff.is_due(backoff.due_ns() - 1) && backoff.is_due(backoff.due_ns()));
        }
        assert_eq!(pauses, [1, 2, 4, 8, 8, 8, 8]);
        backoff.succeeded();
        assert!(backoff.is_due(0));
        backoff.failed(0);
        assert_eq!(backoff.due_ns(), FIRST_NS);
    }
}

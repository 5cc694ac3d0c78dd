//! How often something large that changes is shown.

/// The pace of one view.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// As often as this ...
    period_ns: i64,
    /// ... or as seldom as it takes no more than this before compression: whole graphs and grids
    /// would otherwise take the square of a drive's length.
    bytes_per_second: i64,
    last_ns: Option<i64>,
    has_changed: bool,
}

impl Pace {
    /// Nothing is there yet.
    pub fn new(period_ns: i64, bytes_per_second: i64) -> Self {
        Self {
            period_ns,
            bytes_per_second,
            last_ns: None,
            has_changed: false,
        }
    }

    /// The next one is shown, whenever the last one was, and whether or not it is new.
    pub fn restart(&mut self) {
        (self.last_ns, self.has_changed) = (None, true);
    }

    /// There is something new.
    pub fn change(&mut self) {
        self.has_changed = true;
    }

    /// Whether something new is there that has not been shown.
    pub fn is_behind(&self) -> bool {
        self.has_changed
    }

    /// Whether it is to be shown now, being so large. A clock that jumps back is no reason to
    /// wait.
    pub fn is_due(&mut self, now_ns: i64, bytes: usize) -> bool {
        let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
        let pause_ns = bytes.saturating_mul(1_000_000_000) / self.bytes_per_second.max(1);
        let pause_ns = pause_ns.max(self.period_ns);
        let early =
            (self.last_ns).is_some_and(|last_ns| (0..pause_ns).contains(&(now_ns - last_ns)));
        if early || !self.has_changed {
            return false;
        }
        self.last_ns = Some(now_ns);
        self.has_changed = false;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_the_more_seldom_and_only_what_has_changed() {
        const S: i64 = 1_000_000_000;
        let mut pace = Pace::new(2 * S, 500_000);
        assert!(!pace.is_due(0, 1));
        pace.change();
        assert!(pace.is_due(0, 1) && !pace.is_due(9 * S, 1));
        pace.change();
        assert!(!pace.is_due(S, 1) && pace.is_due(2 * S, 1));
        pace.change();
        assert!(!pace.is_due(7 * S, 3_000_000) && pace.is_due(8 * S, 3_000_000));
        pace.change();
        assert!(pace.is_due(S, 1) && !pace.is_behind());
        pace.restart();
        assert!(pace.is_due(S, 1));
    }
}

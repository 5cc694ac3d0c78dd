//! How often something large that changes is shown.

/// As often as this ...
const PERIOD_NS: i64 = 2_000_000_000;
/// ... or as seldom as it takes no more than this before compression: whole graphs and grids would
/// otherwise take the square of a drive's length.
const BYTES_PER_SECOND: i64 = 500_000;

/// The pace of one view.
#[derive(Debug, Default)]
pub struct Pace {
    last_ns: Option<i64>,
    has_changed: bool,
}

impl Pace {
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
        let pause_ns = bytes.saturating_mul(1_000_000_000) / BYTES_PER_SECOND;
        let pause_ns = pause_ns.max(PERIOD_NS);
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
        let mut pace = Pace::default();
        assert!(!pace.is_due(0, 1));
        pace.change();
        assert!(pace.is_due(0, 1) && !pace.is_due(9 * S, 1));
        pace.change();
        assert!(!pace.is_due(S, 1) && pace.is_due(2 * S, 1));
        pace.change();
        assert!(!pace.is_due(7 * S, 3_000_000) && pace.is_due(8 * S, 3_000_000));
        pace.change();
        assert!(pace.is_due(S, 1) && !pace.is_behind());
    }
}

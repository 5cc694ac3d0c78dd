//! The order of lines of one kind, by their numbers.

/// A number that is further back is that of a device begun anew: datagrams change places with
/// those of the same tenth of a second.
const LATE_MAX: i16 = 64;

/// What was counted, and the last number.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LineOrder {
    last: Option<u16>,
    /// Numbers that did not come.
    pub lost: u64,
    /// Lines that came after one that follows them.
    pub late: u64,
    /// Lines that repeat the last number.
    pub doubled: u64,
}

impl LineOrder {
    /// Another device may speak from now on.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Whether a line is to be used. One without a number always is.
    pub fn is_next(&mut self, sequence: Option<u16>) -> bool {
        let (Some(now), Some(last)) = (sequence, self.last) else {
            self.last = sequence;
            return true;
        };
        // The shorter way around the numbers.
        match now.wrapping_sub(last) as i16 {
            0 => {
                self.doubled += 1;
                return false;
            }
            step if (-LATE_MAX..0).contains(&step) => {
                self.late += 1;
                return false;
            }
            step => self.lost += u64::from(step.max(1).unsigned_abs()) - 1,
        }
        self.last = Some(now);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_out_of_order_are_left_out() {
        let mut order = LineOrder::default();
        let numbers = [65_534, 65_535, 0, 3, 2, 3, 4, 10, 0, 9];
        let used = numbers.map(|number| order.is_next(Some(number)));
        let expected = [
            true, true, true, true, false, false, true, true, false, false,
        ];
        assert_eq!(used, expected);
        assert_eq!((order.lost, order.late, order.doubled), (2 + 5, 3, 1));
        // Begun anew.
        assert!(order.is_next(Some(65_000)) && order.is_next(Some(65_001)));
        assert_eq!(order.lost, 7);
        // Without numbers there is no order.
        assert!(order.is_next(None) && order.is_next(None) && order.is_next(Some(65_001)));
    }
}

//! Which stamps a clock can give, and how a clock that was set back is recognised.

/// A step back of the stamps above this is the clock's, below it a sample out of order, ns (1 s).
const CLOCK_SET_BACK_NS: i64 = 1_000_000_000;

/// Stamps that a clock can give, ns since 1970 (or since the boot): up to the year 2116. Sums of
/// two stay in range.
pub const STAMPS_NS: core::ops::Range<i64> = 0..1 << 62;

/// Whether a stamp is so far before the last one that the clock must have been set back.
pub fn is_set_back(stamp_ns: i64, last_ns: i64) -> bool {
    stamp_ns < last_ns - CLOCK_SET_BACK_NS
}

//! Where the lines of a grid stand.

use std::ops::Range;

/// Decimals of the first unit, and one less of each next one.
const DECIMALS: usize = 6;
/// Powers of ten. Beyond them no quantity of ours is drawn.
const UNITS: [f64; 16] = [
    1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9,
];

/// Smallest of 1, 2, 5 times a power of ten that cuts a span at most this often, with its
/// decimals.
pub(crate) fn step(span: f64, lines_max: f64) -> (f64, usize) {
    let enough = |step: &f64| span / step <= lines_max;
    for (index, unit) in UNITS.into_iter().enumerate() {
        if let Some(step) = [1.0, 2.0, 5.0].map(|n| n * unit).into_iter().find(enough) {
            return (step, DECIMALS.saturating_sub(index));
        }
    }
    (span, 0)
}

/// The multiples of a step inside a range.
pub(crate) fn within(range: &Range<f64>, step: f64) -> Vec<f64> {
    let first = (range.start / step).ceil() as i64;
    let last = (range.end / step).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_few() {
        assert_eq!(step(1.0, 5.0), (0.2, 1));
        assert_eq!(step(59.9, 10.0), (10.0, 0));
        assert_eq!(step(0.0123, 4.0), (0.005, 3));
        assert_eq!(step(0.0, 4.0), (1e-6, 6));
        assert_eq!(step(4e9, 4.0), (1e9, 0));
        assert_eq!(within(&(-0.25..0.41), 0.2), [-0.2, 0.0, 0.2, 0.4]);
    }
}

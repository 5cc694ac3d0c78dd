//! Which numbers a key takes.

use std::fmt;

/// Which numbers a key takes; NaN and infinity never do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// The key has no number.
    NoNumber,
    /// Between these two, both included, and why.
    Within {
        /// The smallest.
        least: f64,
        /// The largest.
        most: f64,
        /// Why not less; why not more.
        because: &'static str,
    },
    /// The shape of the adaptive loss: its powers are taken by square roots, so a multiple of 0.5.
    LossShape,
    /// Factors that fall to 1, so that the last solve is the problem itself.
    Graduation,
}

/// Larger shapes than this change nothing any more.
const LOSS_SHAPE_LEAST: f64 = -16.0;
/// The shape of a loss that still bends: the next multiple of 0.5 is the plain square.
const LOSS_SHAPE_MOST: f64 = 1.5;
/// Each factor is a solve; the paper has three.
const FACTORS_MAX: usize = 10;
/// A loss this much wider than the last one treats everything as an inlier.
const FACTOR_MAX: f64 = 1000.0;

/// Numbers between two, both included, and the reasons for the bounds.
pub(crate) const fn within(least: f64, most: f64, because: &'static str) -> Rule {
    Rule::Within {
        least,
        most,
        because,
    }
}

impl Rule {
    /// Whether a key takes these numbers (one, or a list's).
    pub fn allows(&self, numbers: &[f64]) -> bool {
        match *self {
            Self::NoNumber => true,
            Self::Within { least, most, .. } => {
                numbers.iter().all(|number| (least..=most).contains(number))
            }
            Self::LossShape => numbers.iter().all(|number| {
                let is_inside = (LOSS_SHAPE_LEAST..=LOSS_SHAPE_MOST).contains(number);
                is_inside && (2.0 * number).fract() == 0.0
            }),
            Self::Graduation => {
                numbers.len() <= FACTORS_MAX
                    && numbers.first().is_some_and(|first| *first <= FACTOR_MAX)
                    && numbers.last() == Some(&1.0)
                    && numbers.is_sorted_by(|a, b| a > b)
            }
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoNumber => write!(f, "no number"),
            Self::Within {
                least,
                most,
                because,
            } => write!(f, "from {least} to {most} ({because})"),
            Self::LossShape => write!(
                f,
                "a multiple of 0.5, from {LOSS_SHAPE_LEAST} to {LOSS_SHAPE_MOST}"
            ),
            Self::Graduation => write!(
                f,
                "falling, and 1.0 at the end, {FACTORS_MAX} factors at most, none above {FACTOR_MAX}"
            ),
        }
    }
}

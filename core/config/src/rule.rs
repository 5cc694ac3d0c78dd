//! Which numbers a key takes.

use std::fmt;

/// Which numbers a key takes; NaN and infinity never do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// Any finite number.
    Finite,
    /// Above 0.
    Positive,
    /// 0 or above.
    NotNegative,
    /// From this one up.
    AtLeast(f64),
    /// Between these two, both included.
    Within(f64, f64),
    /// The shape of the adaptive loss: its powers are taken by square roots, so a multiple of 0.5.
    LossShape,
    /// Factors that fall to 1, so that the last solve is the problem itself.
    Graduation,
}

/// Rounder losses than this change nothing any more.
const LOSS_SHAPE_LEAST: f64 = -16.0;

impl Rule {
    /// Whether a key takes these numbers (one, or a list's).
    pub fn allows(&self, numbers: &[f64]) -> bool {
        let each = |holds: &dyn Fn(f64) -> bool| numbers.iter().all(|&n| n.is_finite() && holds(n));
        match *self {
            Self::Finite => each(&|_| true),
            Self::Positive => each(&|n| n > 0.0),
            Self::NotNegative => each(&|n| n >= 0.0),
            Self::AtLeast(least) => each(&|n| n >= least),
            Self::Within(least, most) => each(&|n| least <= n && n <= most),
            Self::LossShape => {
                each(&|n| (LOSS_SHAPE_LEAST..2.0).contains(&n) && (2.0 * n).fract() == 0.0)
            }
            Self::Graduation => {
                each(&|_| true)
                    && numbers.last() == Some(&1.0)
                    && numbers.is_sorted_by(|a, b| a > b)
            }
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => write!(f, "finite"),
            Self::Positive => write!(f, "above 0"),
            Self::NotNegative => write!(f, "0 or above"),
            Self::AtLeast(least) => write!(f, "{least} or above"),
            Self::Within(least, most) => write!(f, "from {least} to {most}"),
            Self::LossShape => {
                write!(f, "a multiple of 0.5, from {LOSS_SHAPE_LEAST} to 1.5")
            }
            Self::Graduation => write!(f, "falling, and 1.0 at the end"),
        }
    }
}

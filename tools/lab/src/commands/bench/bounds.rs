//! What the table must show. Fixed before anything is measured.

use super::figures::Figures;
use super::summary::Group;
use crate::faults::Fault;
use std::fmt;

/// Worlds that fix the pose everywhere, or nearly.
const RICH: &[&str] = &[
    "building", "yard", "tunnel", "rooms", "aisles", "cells", "racks",
];
/// Worlds with stretches that nothing fixes along the way, and structure behind them.
const DEGENERATE: &[&str] = &[
    "corridor40",
    "glass",
    "hall",
    "corridor",
    "glassfront",
    "openfloor",
];
/// Open floor whose walls are out of sight: crossed, and left for.
const OPEN: &[&str] = &["hall", "openfloor"];
const LEFT_FOR: &[&str] = &["leavehall", "outandback"];
/// What has to be noticed.
const NOTICED: &[Fault] = &[
    Fault::Convoy,
    Fault::Interference,
    Fault::Kidnapped,
    Fault::Frozen3,
    Fault::Frozen10,
];
const WITHOUT: &[Fault] = &[Fault::None];

/// How the drives of a group are held against a limit.
#[derive(Clone, Copy, Debug)]
enum Limit {
    /// The worst drive, and none that lacks the figure.
    AllAtMost(f64),
    /// The worst drive that has the figure.
    AtMost(f64),
    /// The worst drive that has the figure.
    AtLeast(f64),
    /// The mean over the drives.
    MeanAtMost(f64),
    /// The mean over the drives.
    MeanWithin(f64, f64),
}

/// One of them.
struct Bound {
    name: &'static str,
    figure: fn(&Figures) -> Option<f64>,
    limit: Limit,
    /// All where there are none.
    worlds: &'static [&'static str],
    faults: &'static [Fault],
}

macro_rules! bound {
    ($figure:ident, $limit:expr, $worlds:expr, $faults:expr) => {
        Bound {
            name: stringify!($figure),
            figure: |figures| figures.$figure,
            limit: $limit,
            worlds: $worlds,
            faults: $faults,
        }
    };
}

const BOUNDS: &[Bound] = &[
    bound!(silent_m, Limit::AllAtMost(0.0), &[], WITHOUT),
    bound!(silent_m, Limit::AllAtMost(0.0), &[], NOTICED),
    bound!(flagged_s, Limit::AllAtMost(5.0), &[], NOTICED),
    bound!(changes_per_min, Limit::AtMost(6.0), &[], WITHOUT),
    bound!(good_of_held, Limit::AtLeast(0.9), &[], WITHOUT),
    bound!(good, Limit::AtLeast(0.98), RICH, WITHOUT),
    bound!(stretches_late, Limit::AtMost(0.0), DEGENERATE, WITHOUT),
    bound!(
        stretch_good_again_s,
        Limit::AtMost(3.0),
        DEGENERATE,
        WITHOUT
    ),
    bound!(direction_deg, Limit::AtMost(10.0), DEGENERATE, WITHOUT),
    bound!(
        stretch_inside,
        Limit::MeanWithin(0.9, 1.0),
        DEGENERATE,
        WITHOUT
    ),
    bound!(
        stretch_axis_per_error,
        Limit::MeanAtMost(4.0),
        DEGENERATE,
        WITHOUT
    ),
    bound!(frames, Limit::AtMost(2.0), OPEN, WITHOUT),
    bound!(unjoined, Limit::AtMost(0.0), OPEN, WITHOUT),
    bound!(frames, Limit::AtMost(3.0), LEFT_FOR, WITHOUT),
    bound!(nees_straight, Limit::MeanWithin(1.5, 6.0), RICH, WITHOUT),
    bound!(nees_turn, Limit::MeanWithin(1.5, 6.0), RICH, WITHOUT),
    bound!(nees_standstill, Limit::MeanAtMost(6.0), RICH, WITHOUT),
    bound!(nees_inside, Limit::MeanWithin(0.9, 0.995), RICH, WITHOUT),
];

/// A bound that a group breaks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Broken {
    world: String,
    fault: Fault,
    name: &'static str,
    /// None where a drive has none.
    value: Option<f64>,
    limit: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (world, fault, name, limit) = (&self.world, self.fault, self.name, &self.limit);
        write!(f, "{world}, {fault}: {name} ")?;
        match self.value {
            Some(value) => write!(f, "{value:.4}")?,
            None => write!(f, "never")?,
        }
        write!(f, ", {limit}")
    }
}

/// The bounds that a group breaks.
pub(super) fn broken(group: &Group<'_>) -> Vec<Broken> {
    let applies = |bound: &&Bound| {
        (bound.worlds.is_empty() || bound.worlds.contains(&group.world))
            && bound.faults.contains(&group.fault)
    };
    let check = |bound: &Bound| {
        let values = group.values(bound.figure);
        let (value, limit) = bound.limit.broken_by(&values, group.cells.len())?;
        Some(Broken {
            world: group.world.to_owned(),
            fault: group.fault,
            name: bound.name,
            value,
            limit,
        })
    };
    BOUNDS.iter().filter(applies).filter_map(check).collect()
}

impl Limit {
    /// The value that breaks it, none where a drive lacks one, and the limit in words.
    fn broken_by(self, values: &[f64], drives: usize) -> Option<(Option<f64>, String)> {
        let largest = values.iter().copied().reduce(f64::max);
        let least = values.iter().copied().reduce(f64::min);
        let count = values.len().max(1) as f64;
        let mean = least.map(|_| values.iter().sum::<f64>() / count);
        let (value, is_broken, limit) = match self {
            Self::AllAtMost(limit) => {
                let all = largest.filter(|_| values.len() == drives);
                let is_broken = all.is_none_or(|value| value > limit);
                (all, is_broken, format!("at most {limit}"))
            }
            Self::AtMost(limit) => {
                let is_broken = largest.is_some_and(|value| value > limit);
                (largest, is_broken, format!("at most {limit}"))
            }
            Self::AtLeast(limit) => {
                let is_broken = least.is_some_and(|value| value < limit);
                (least, is_broken, format!("at least {limit}"))
            }
            Self::MeanAtMost(limit) => {
                let is_broken = mean.is_some_and(|value| value > limit);
                (mean, is_broken, format!("on average at most {limit}"))
            }
            Self::MeanWithin(low, high) => {
                let is_broken = mean.is_some_and(|value| !(low..=high).contains(&value));
                (mean, is_broken, format!("on average {low} to {high}"))
            }
        };
        is_broken.then_some((value, limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_drive_counts_or_the_mean() {
        let is_broken = |limit: Limit, values: &[f64]| limit.broken_by(values, 2).is_some();
        assert!(is_broken(Limit::AtMost(6.0), &[1.0, 6.1]));
        assert!(!is_broken(Limit::AtMost(6.0), &[1.0]));
        assert!(
            is_broken(Limit::AllAtMost(6.0), &[1.0]),
            "the other one has none"
        );
        assert!(is_broken(Limit::AtLeast(0.9), &[0.95, 0.8]));
        assert!(!is_broken(Limit::AtLeast(0.9), &[]));
        assert!(!is_broken(Limit::MeanWithin(1.5, 6.0), &[1.0, 7.0]));
        assert!(is_broken(Limit::MeanWithin(1.5, 6.0), &[1.0, 1.5]));
        assert!(is_broken(Limit::MeanAtMost(6.0), &[1.0, 12.0]));
    }
}

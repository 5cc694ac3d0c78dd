//! Drives of one world under one fault, all seeds together; and whether they are worse than those
//! of another table.

use super::figures::{Better, COLUMNS, Column, Figures};
use super::record::Cell;
use crate::faults::Fault;
use std::fmt;

/// The seeds of a world under a fault.
#[derive(Clone, Debug)]
pub(super) struct Group<'a> {
    /// Its world.
    pub world: &'a str,
    /// The fault.
    pub fault: Fault,
    /// The drives.
    pub cells: Vec<&'a Cell>,
}

/// Drives in groups, in order of their first ones.
pub(super) fn groups(cells: &[Cell]) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for cell in cells {
        let (world, fault) = (cell.trial.world.as_str(), cell.trial.fault);
        let same = |group: &&mut Group<'_>| group.world == world && group.fault == fault;
        match groups.iter_mut().find(same) {
            Some(group) => group.cells.push(cell),
            None => groups.push(Group {
                world,
                fault,
                cells: vec![cell],
            }),
        }
    }
    groups
}

impl Group<'_> {
    /// A figure of each drive that has one.
    pub fn values(&self, figure: fn(&Figures) -> Option<f64>) -> Vec<f64> {
        let figures = self.cells.iter().map(|cell| figure(&cell.figures));
        figures.flatten().collect()
    }

    /// Its median.
    pub fn median(&self, figure: fn(&Figures) -> Option<f64>) -> Option<f64> {
        median(self.values(figure))
    }

    /// Its sum; none where no drive has one.
    pub fn sum(&self, figure: fn(&Figures) -> Option<f64>) -> Option<f64> {
        let values = self.values(figure);
        (!values.is_empty()).then(|| values.iter().sum())
    }
}

/// A figure that is worse than it was by more than its spread.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Worse {
    world: String,
    fault: Fault,
    figure: &'static str,
    /// Medians; none where most drives have none, such as of a fault that was never flagged.
    medians: [Option<f64>; 2],
}

impl fmt::Display for Worse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [old, new] = self.medians.map(|median| match median {
            Some(median) => format!("{median}"),
            None => "none".to_owned(),
        });
        let (world, fault, figure) = (&self.world, self.fault, self.figure);
        write!(f, "{world}, {fault}: {figure} {new}, was {old}")
    }
}

/// What is worse than in an older table, of the drives that are in both: where the median over the
/// seeds is worse than the old one by more than half the old range over the seeds.
pub(super) fn worse(new: &[Cell], old: &[Cell]) -> Vec<Worse> {
    let mut found = Vec::new();
    for group in groups(new) {
        // Where a drive is there twice the latest one counts.
        let last = |cell: &&&Cell| old.iter().rev().find(|other| other.trial == cell.trial);
        let pairs = group
            .cells
            .iter()
            .filter_map(|cell| Some((*cell, last(&cell)?)));
        let (new, old): (Vec<&Cell>, Vec<&Cell>) = pairs.unzip();
        if new.is_empty() {
            continue;
        }
        for column in COLUMNS {
            let [was, is] = [&old, &new].map(|cells| spread(cells, column));
            // The last digit may be rounded either way.
            let rounding = 0.5 * randt_geometry::elementary::pow(0.1, column.decimals as f64);
            if is[1] - was[1] > 0.5 * (was[2] - was[0]) + rounding {
                let shown = |spread: [f64; 3]| Some(spread[1].abs()).filter(|m| m.is_finite());
                found.push(Worse {
                    world: group.world.to_owned(),
                    fault: group.fault,
                    figure: column.name,
                    medians: [shown(was), shown(is)],
                });
            }
        }
    }
    found
}

/// Least, median and largest of a figure, the larger the worse; one that is missing is the worst.
fn spread(cells: &[&Cell], column: &Column) -> [f64; 3] {
    let value = |cell: &&Cell| match (column.better, cell.figures.get(column.name)) {
        (Better::Neither, _) => 0.0,
        (_, None) => f64::INFINITY,
        (Better::Less, Some(value)) => value,
        (Better::More, Some(value)) => -value,
    };
    let mut values: Vec<f64> = cells.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    let [least, largest] = [values.first(), values.last()].map(|v| v.copied().unwrap_or(0.0));
    [least, median(values).unwrap_or(0.0), largest]
}

/// The middle value; of an even number the mean of both middle ones.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    let lower = values.get((values.len() - 1) / 2)?;
    Some(0.5 * (lower + upper))
}

/// The least value that this share of the values does not exceed.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1)).copied()
}

#[cfg(test)]
mod tests {
    use super::super::plan::Trial;
    use super::super::record::Build;
    use super::*;

    fn cells(ate_m: &[f64], flagged_s: &[Option<f64>]) -> Vec<Cell> {
        let cell = |(seed, ate_m): (u64, &f64)| Cell {
            build: Build {
                binary_sha256: String::new(),
                randt: String::new(),
                settings: String::new(),
            },
            trial: Trial {
                world: "yard".to_owned(),
                world_sha256: String::new(),
                fault: Fault::Convoy,
                seed,
                scans: 100,
            },
            figures: Figures {
                live_ate_m: Some(*ate_m),
                flagged_s: flagged_s.get(seed as usize - 1).copied().flatten(),
                ..Figures::default()
            },
        };
        (1..).zip(ate_m).map(cell).collect()
    }

    fn names(new: &[Cell], old: &[Cell]) -> Vec<&'static str> {
        worse(new, old).iter().map(|it| it.figure).collect()
    }

    #[test]
    fn worse_is_a_median_beyond_half_the_old_range() {
        let old = cells(&[0.1, 0.2, 0.3], &[]);
        let none: [&str; 0] = [];
        assert_eq!(names(&cells(&[0.1, 0.29, 0.9], &[]), &old), none);
        assert_eq!(names(&cells(&[0.1, 0.31, 0.4], &[]), &old), ["live_ate_m"]);
        assert_eq!(names(&cells(&[0.0, 0.1, 0.1], &[]), &old), none);
        // Seeds that only one table has say nothing.
        assert_eq!(
            names(&cells(&[0.1, 0.2, 0.3, 9.0, 9.0, 9.0], &[]), &old),
            none
        );
    }

    #[test]
    fn what_is_not_flagged_any_more_is_worse() {
        let ate_m = [0.1, 0.1, 0.1];
        let flagged = cells(&ate_m, &[Some(1.0), Some(2.0), Some(3.0)]);
        let missed = cells(&ate_m, &[Some(1.0), None, None]);
        let found = worse(&missed, &flagged);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].to_string(), "yard, convoy: flagged_s none, was 2");
        assert!(worse(&flagged, &missed).is_empty());
        assert!(worse(&missed, &missed).is_empty());
    }

    #[test]
    fn nine_of_ten_are_below_the_quantile() {
        let ten: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(quantile(ten, 0.9), Some(9.0));
        assert_eq!(quantile(vec![3.0], 0.9), Some(3.0));
        assert_eq!(quantile(Vec::new(), 0.9), None);
    }
}

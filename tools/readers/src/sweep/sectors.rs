//! Messages that hold a part of a turn each, which no sweep can be made of.

use super::polar::Polar;
use randt_geometry::elementary::PI;

/// Sectors of a turn.
const SECTORS: u32 = 8;
/// Fewer points may lie in one sector by chance.
const POINTS_MIN: usize = 20;

/// Whether the sweeps see half a turn or less each, and all of it together.
pub(crate) fn are_sectors(sweeps: &[Polar]) -> bool {
    let seen = |sweep: &Polar| {
        let points = sweep.points.iter();
        points.fold(0_u32, |seen, point| {
            let share = (point.azimuth_rad + PI) / (2.0 * PI);
            seen | 1 << ((share * f64::from(SECTORS)) as u32).min(SECTORS - 1)
        })
    };
    let full = sweeps
        .iter()
        .filter(|sweep| sweep.points.len() >= POINTS_MIN);
    let seen: Vec<u32> = full.map(seen).collect();
    let together = seen.iter().fold(0, |all, one| all | one);
    together.count_ones() == SECTORS && seen.iter().all(|one| one.count_ones() <= SECTORS / 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::PolarPoint;

    /// A sweep from `begin` to `end`, in turns.
    fn sweep(begin: f64, end: f64) -> Polar {
        let point = |index: i32| PolarPoint {
            azimuth_rad: (begin + (end - begin) * f64::from(index) / 100.0) * 2.0 * PI - PI,
            range_m: 1.0,
            intensity: 1.0,
        };
        Polar {
            points: (0..100).map(point).collect(),
            ..Polar::default()
        }
    }

    #[test]
    fn quarters_of_a_turn_are_no_sweeps() {
        let quarter =
            |index: i32| sweep(0.25 * f64::from(index % 4), 0.25 * f64::from(index % 4 + 1));
        let quarters: Vec<Polar> = (0..8).map(quarter).collect();
        assert!(are_sectors(&quarters));
        // A radar that sees one side only, whole turns, and turns with a few returns.
        assert!(!are_sectors(&[quarter(0), quarter(0)]));
        assert!(!are_sectors(&[sweep(0.0, 1.0), quarter(0)]));
        let mut few = quarters;
        few.iter_mut().for_each(|sweep| sweep.points.truncate(9));
        assert!(!are_sectors(&few));
    }
}

//! A cell: the normal distribution that represents the points in one square of the grid.

use crate::Distribution;
use randt_persist::persist;

/// Smaller eigenvalue of the position covariance, at least this share of the larger (RaNDT,
/// III-B): a wall in a cell must not become infinitely thin.
const EIGENVALUE_RATIO_MIN: f64 = 0.001;
/// Smallest variance of a position, m^2 (5 mm): below a third of the finest range bin nothing is
/// known.
const POSITION_VARIANCE_MIN: f64 = 2.5e-5;
/// Added to the variance of the intensity (RaNDT, III-B), so that equal intensities stay
/// invertible.
const INTENSITY_VARIANCE_MIN: f64 = 1e-6;
/// Variance that makes the intensity dimension silent: the distance in it then vanishes.
const INTENSITY_VARIANCE_SILENT: f64 = 1e12;

/// When a cell counts and what it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellRule {
    /// Points from which a cell is used.
    pub points_min: u32,
    /// Whether intensity is compared.
    pub use_intensity: bool,
    /// Edge of the square that cuts the points, m.
    pub cell_size_m: f64,
    /// How much less information a cell has along a direction in which the points fill the square;
    /// 0: not less.
    pub slack: f64,
}

/// From this share of an evenly filled square's variance on, a cell fills its square along an
/// axis.
const FILLED_SHARE: f64 = 0.5;

impl CellRule {
    /// Variance from which a cell fills its square along an axis, m^2.
    pub(crate) fn filled_variance_m2(&self) -> f64 {
        let full = self.cell_size_m * self.cell_size_m / 12.0;
        let filled = FILLED_SHARE * full;
        filled * (1.0 + self.slack * FILLED_SHARE * FILLED_SHARE)
    }
}

/// A normal distribution over x (m), y (m) and intensity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Mean.
    pub mean: [f64; 3],
    /// Covariance: xx, xy, yy, xi, yi, ii.
    pub covariance: [f64; 6],
    /// Points behind it.
    pub count: u32,
}

persist!(Cell {
    mean,
    covariance,
    count
});

impl Cell {
    /// The cell of sample statistics; `None` where there are too few points.
    pub fn new(sum: &Distribution, rule: CellRule) -> Option<Self> {
        if sum.count < rule.points_min.max(2) {
            return None;
        }
        let scale = 1.0 / (f64::from(sum.count) - 1.0);
        let mut covariance = sum.scatter.map(|s| s * scale);
        let plane = [covariance[0], covariance[1], covariance[2]];
        let full = rule.cell_size_m * rule.cell_size_m / 12.0;
        let [xx, xy, yy] = slacken(floor_eigenvalues(plane), full, rule.slack);
        [covariance[0], covariance[1], covariance[2]] = [xx, xy, yy];
        if rule.use_intensity {
            covariance[5] += INTENSITY_VARIANCE_MIN;
        } else {
            covariance[3] = 0.0;
            covariance[4] = 0.0;
            covariance[5] = INTENSITY_VARIANCE_SILENT;
        }
        Some(Self {
            mean: sum.mean,
            covariance,
            count: sum.count,
        })
    }
}

/// Widens a symmetric 2 x 2 matrix (xx, xy, yy) along the axes in which it fills its square: each
/// eigenvalue l grows by 1 + slack (l / full)^2, `full` being the variance of an evenly filled
/// square.
///
/// A wall that runs through a square is cut by it, so the middle of the piece shows where the
/// square is, not where the wall is.
fn slacken(plane: [f64; 3], full: f64, slack: f64) -> [f64; 3] {
    let widened = |l: f64| l * (1.0 + slack * (l / full) * (l / full));
    map_eigenvalues(plane, |large, small| {
        (widened(large), widened(small.max(0.0)))
    })
}

/// Raises the smaller eigenvalues of a symmetric 2 x 2 matrix (xx, xy, yy), keeping its axes.
fn floor_eigenvalues(plane: [f64; 3]) -> [f64; 3] {
    map_eigenvalues(plane, |large, small| {
        let large = large.max(POSITION_VARIANCE_MIN);
        let least = small.max(EIGENVALUE_RATIO_MIN * large);
        (large, least.max(POSITION_VARIANCE_MIN))
    })
}

/// The symmetric matrix (xx, xy, yy) of the same axes, whose eigenvalues are a function of those
/// of the given one.
fn map_eigenvalues([xx, xy, yy]: [f64; 3], map: impl Fn(f64, f64) -> (f64, f64)) -> [f64; 3] {
    let half_trace = 0.5 * (xx + yy);
    let half_difference = 0.5 * (xx - yy);
    let radius = (half_difference * half_difference + xy * xy).sqrt();
    let (large, small) = map(half_trace + radius, half_trace - radius);
    if radius <= 0.0 {
        return [large, 0.0, large];
    }
    // M = half_trace I + radius N with N of eigenvalues +1 and -1; only the two scalars change.
    let (trace, scale) = (0.5 * (large + small), 0.5 * (large - small) / radius);
    let half_difference = half_difference * scale;
    [trace + half_difference, xy * scale, trace - half_difference]
}

/// A cell of a scan that is being registered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScanCell {
    /// In the frame of the scan.
    pub cell: Cell,
    /// How far its mean moves with the velocity that the scan was de-skewed by: d mean / d
    /// velocity, s. 0 for a scan taken at one instant, about minus the mean age of its points
    /// otherwise.
    pub velocity_jacobian_s: f64,
}

persist!(ScanCell {
    cell,
    velocity_jacobian_s
});

impl ScanCell {
    /// A cell with its derivative by the velocity.
    pub fn new(cell: &Cell, velocity_jacobian_s: f64) -> Self {
        Self {
            cell: *cell,
            velocity_jacobian_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RULE: CellRule = CellRule {
        points_min: 4,
        use_intensity: true,
        cell_size_m: 1.0,
        slack: 0.0,
    };

    proptest! {
        #[test]
        fn floored_covariances_are_positive_definite_and_keep_good_ones(a in 0.0..4.0f64, b in 0.0..4.0f64, c in -1.0..1.0f64) {
            let xy = c * (a * b).sqrt();
            let [xx, xy2, yy] = floor_eigenvalues([a, xy, b]);
            prop_assert!(xx > 0.0 && yy > 0.0 && xx * yy - xy2 * xy2 > 0.0);
            if c.abs() < 0.9 && a.min(b) > 0.1 {
                prop_assert!((xx - a).abs() < 1e-9 && (xy2 - xy).abs() < 1e-9 && (yy - b).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_wall_through_the_square_says_little_along_and_as_much_across() {
        let wall = |length_m: f64| {
            let mut sum = Distribution::default();
            for i in 0..100 {
                let along = (f64::from(i) * 0.01 - 0.495) * length_m;
                sum.add([along, 0.02 * f64::from(i % 3), 9.0 + f64::from(i % 2)]);
            }
            let rule = |slack| CellRule { slack, ..RULE };
            let plain = Cell::new(&sum, rule(0.0)).unwrap().covariance;
            let slack = Cell::new(&sum, rule(5.0)).unwrap().covariance;
            (slack[0] / plain[0], slack[2] / plain[2])
        };
        let (along, across) = wall(1.0);
        assert!(
            (along - 6.0).abs() < 0.3 && (across - 1.0).abs() < 0.01,
            "{along} {across}"
        );
        // A post or a wall's end is where it is.
        assert!((wall(0.2).0 - 1.0).abs() < 0.01);
    }

    #[test]
    fn points_on_a_line_give_a_thin_but_invertible_cell() {
        let mut sum = Distribution::default();
        (0..10).for_each(|i| sum.add([f64::from(i) * 0.05, f64::from(i) * 0.05, 9.0]));
        let [xx, xy, yy, _, _, ii] = Cell::new(&sum, RULE).unwrap().covariance;
        assert!(xx * yy - xy * xy > 1e-7 && ii > 0.0);
        assert_eq!(
            Cell::new(
                &sum,
                CellRule {
                    points_min: 11,
                    ..RULE
                }
            ),
            None
        );
    }
}

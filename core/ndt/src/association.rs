//! Which cells of the map each cell of a scan is compared with.

use crate::{Cell, CellRule, Grid, ScanCell, scalar};
use randt_geometry::Pose2;

/// Most cells of the map per cell of a scan; one SIMD lane each.
pub const NEIGHBOURS_MAX: usize = 4;
/// Squares searched to each side: a prediction is within one cell, so the true one is in these.
const SEARCH_RADIUS: i64 = 1;
/// Index that means "no cell".
const NO_CELL: u32 = u32::MAX;
/// Variance along an ignored direction, m^2: a scan of full weight holds it with less than a
/// kilometre's stiffness, and the inverse still has ten digits across it.
const IGNORED_VARIANCE_M2: f64 = 1e8;

/// The map cells of smallest distance d^T S^-1 d for one cell of a scan, nearest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Association {
    /// Number of cells in use.
    pub count: usize,
    /// Means of the map's cells, by component, then lane; lanes out of use repeat lane 0.
    pub mean: [[f64; 4]; 3],
    /// Covariances: xx, xy, yy, xi, yi, ii.
    pub covariance: [[f64; 4]; 6],
    /// 1 for lanes in use, 0 for others.
    pub in_use: [f64; 4],
    /// Squared distance of the nearest one, without the robust loss.
    pub nearest: f64,
}

impl Association {
    const EMPTY: Self = Self {
        count: 0,
        mean: [[0.0; 4]; 3],
        // Invertible, so that an empty lane gives zeros and no NaN.
        covariance: [[1.0; 4], [0.0; 4], [1.0; 4], [0.0; 4], [0.0; 4], [1.0; 4]],
        in_use: [0.0; 4],
        nearest: f64::INFINITY,
    };

    /// Finds for each cell of the scan the `neighbours` nearest ones of the map, seen from `pose`.
    ///
    /// `out` gets one entry a cell; its capacity is reused.
    pub fn find(
        map: &Grid,
        cells: &[ScanCell],
        pose: &Pose2,
        neighbours: usize,
        out: &mut Vec<Self>,
    ) {
        out.clear();
        let neighbours = neighbours.clamp(1, NEIGHBOURS_MAX);
        let cells = cells.iter().map(|scan| &scan.cell);
        out.extend(cells.map(|cell| Self::nearest_to(map, cell, pose, neighbours)));
    }

    /// Takes what the grid's own cuts seem to say out of the comparison: along an axis in which a
    /// cell of the map fills its square, distances count for nothing. What is left there is the
    /// residual across it.
    pub fn ignore_filled_axes(associations: &mut [Self], rule: CellRule) {
        let filled = rule.filled_variance_m2();
        for association in associations {
            let [xx, xy, yy, ..] = &mut association.covariance;
            for ((xx, xy), yy) in xx.iter_mut().zip(xy).zip(yy) {
                let half_difference = 0.5 * (*xx - *yy);
                let radius = (half_difference * half_difference + *xy * *xy).sqrt();
                let half_trace = 0.5 * (*xx + *yy);
                if half_trace - radius >= filled {
                    *xx += IGNORED_VARIANCE_M2;
                    *yy += IGNORED_VARIANCE_M2;
                } else if half_trace + radius >= filled {
                    // The projection onto the long axis.
                    let (cos_2, sin_2) = (half_difference / radius, *xy / radius);
                    *xx += IGNORED_VARIANCE_M2 * 0.5 * (1.0 + cos_2);
                    *xy += IGNORED_VARIANCE_M2 * 0.5 * sin_2;
                    *yy += IGNORED_VARIANCE_M2 * 0.5 * (1.0 - cos_2);
                }
            }
        }
    }

    /// Takes a direction of the map out of the comparison: distances along it count for nothing.
    ///
    /// `direction` is a unit vector in the map's frame. What is left is the residual across it.
    pub fn ignore_along(associations: &mut [Self], [dx, dy]: [f64; 2]) {
        let along = [dx * dx, dx * dy, dy * dy].map(|d| d * IGNORED_VARIANCE_M2);
        for association in associations {
            for (lanes, wider) in association.covariance.iter_mut().zip(along) {
                lanes.iter_mut().for_each(|lane| *lane += wider);
            }
        }
    }

    fn nearest_to(map: &Grid, cell: &Cell, pose: &Pose2, neighbours: usize) -> Self {
        let moved = scalar::moved(cell, pose);
        let mut best = [(f64::INFINITY, NO_CELL); NEIGHBOURS_MAX];
        let [x_m, y_m, _] = moved.mean;
        map.for_each_near(x_m, y_m, SEARCH_RADIUS, |index, other| {
            let mut entry = (scalar::squared_distance(&moved, other), index);
            // Insertion keeps the first of equals, so ties go by the grid's order.
            for held in best.iter_mut().take(neighbours) {
                if entry.0 < held.0 {
                    core::mem::swap(&mut entry, held);
                }
            }
        });
        let mut association = Self::EMPTY;
        association.nearest = best[0].0;
        for (lane, (_, index)) in best.iter().enumerate() {
            let Some(other) = map.cell(*index as usize) else {
                break;
            };
            association.count += 1;
            association.in_use[lane] = 1.0;
            for (values, value) in association.mean.iter_mut().zip(other.mean) {
                values[lane] = value;
            }
            for (values, value) in association.covariance.iter_mut().zip(other.covariance) {
                values[lane] = value;
            }
        }
        association
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use randt_geometry::elementary::sin_cos;

    const RULE: CellRule = CellRule {
        points_min: 4,
        use_intensity: true,
        cell_size_m: 1.0,
        slack: 5.0,
    };

    /// A cell with these variances along a direction and across it, m^2.
    fn association(direction_rad: f64, along: f64, across: f64) -> Association {
        let (sin, cos) = sin_cos(direction_rad);
        let turn = Matrix2::new(cos, -sin, sin, cos);
        let covariance = turn * Matrix2::new(along, 0.0, 0.0, across) * turn.transpose();
        let mut association = Association::EMPTY;
        for lane in 0..4 {
            association.covariance[0][lane] = covariance.m11;
            association.covariance[1][lane] = covariance.m12;
            association.covariance[2][lane] = covariance.m22;
        }
        association
    }

    /// Information along a direction and across it, with nothing known of the other, 1/m^2.
    fn information(association: &Association, direction_rad: f64) -> [f64; 2] {
        let [xx, xy, yy, ..] = association.covariance.map(|lanes| lanes[3]);
        let inverse = Matrix2::new(xx, xy, xy, yy).try_inverse().unwrap();
        let (sin, cos) = sin_cos(direction_rad);
        [Vector2::new(cos, sin), Vector2::new(-sin, cos)].map(|axis| axis.dot(&(inverse * axis)))
    }

    #[test]
    fn a_wall_says_nothing_along_and_as_much_across_a_post_all() {
        let full = RULE.cell_size_m * RULE.cell_size_m / 12.0;
        for degrees in (-180..180).step_by(7) {
            let direction_rad = f64::from(degrees).to_radians();
            let wall = association(direction_rad, full * (1.0 + RULE.slack), 0.01);
            let (post, mut all) = (association(direction_rad, 0.02, 0.01), [wall; 2]);
            all[1] = post;
            Association::ignore_filled_axes(&mut all, RULE);
            let [along, across] = information(&all[0], direction_rad);
            assert!(
                along < 1e-6 && (across - 100.0).abs() < 1e-3,
                "{along} {across}"
            );
            assert_eq!(all[1], post);

            let mut ignored = [post];
            let (sin, cos) = sin_cos(direction_rad);
            Association::ignore_along(&mut ignored, [cos, sin]);
            let [along, across] = information(&ignored[0], direction_rad);
            assert!(
                along < 1e-6 && (across - 100.0).abs() < 1e-3,
                "{along} {across}"
            );
        }
    }

    #[test]
    fn a_cell_that_fills_its_square_says_nothing() {
        let full = 0.5 * (1.0 + RULE.slack);
        let mut blob = [association(0.3, full, full)];
        Association::ignore_filled_axes(&mut blob, RULE);
        assert!(information(&blob[0], 0.0).iter().all(|i| *i < 1e-6));
    }
}

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

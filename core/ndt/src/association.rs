//! Which cells of the map each cell of a scan is compared with.

use crate::{Cell, Grid, ScanCell, scalar};
use randt_geometry::Pose2;

/// Most cells of the map per cell of a scan; one SIMD lane each.
pub const NEIGHBOURS_MAX: usize = 4;
/// Squares searched to each side: a prediction is within one cell, so the true one is in these.
const SEARCH_RADIUS: i64 = 1;
/// Index that means "no cell".
const NO_CELL: u32 = u32::MAX;

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

//! One correspondence in plain scalars, as the association search uses it.

use crate::{Cell, distribution::difference};
use randt_geometry::Pose2;

/// A cell in the frame in which `pose` is given: mean R mu + t, covariance R S R^T.
#[inline]
pub fn moved(cell: &Cell, pose: &Pose2) -> Cell {
    let (c, s) = pose.cos_sin();
    let [x, y, i] = cell.mean;
    let [xx, xy, yy, xi, yi, ii] = cell.covariance;
    Cell {
        mean: [c * x - s * y + pose.x_m, s * x + c * y + pose.y_m, i],
        covariance: [
            c * c * xx - 2.0 * c * s * xy + s * s * yy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            s * s * xx + 2.0 * c * s * xy + c * c * yy,
            c * xi - s * yi,
            s * xi + c * yi,
            ii,
        ],
        count: cell.count,
    }
}

/// d^T (S_a + S_b)^-1 d, d = mu_a - mu_b.
#[inline]
pub fn squared_distance(a: &Cell, b: &Cell) -> f64 {
    let d = difference(a.mean, b.mean);
    let mut s = a.covariance;
    for (s, b) in s.iter_mut().zip(b.covariance) {
        *s += b;
    }
    let [xx, xy, yy, xi, yi, ii] = s;
    let (a11, a12, a13) = (yy * ii - yi * yi, xi * yi - xy * ii, xy * yi - yy * xi);
    let (a22, a23, a33) = (xx * ii - xi * xi, xy * xi - xx * yi, xx * yy - xy * xy);
    let determinant = xx * a11 + xy * a12 + xi * a13;
    let quadratic = d[0] * (a11 * d[0] + 2.0 * (a12 * d[1] + a13 * d[2]))
        + d[1] * (a22 * d[1] + 2.0 * a23 * d[2])
        + a33 * d[2] * d[2];
    quadratic / determinant
}

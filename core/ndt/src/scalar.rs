//! One correspondence in plain scalars: what the association search uses, and the oracle of the
//! lanes.

use crate::{AdaptiveLoss, Association, Cell, NormalEquations, ScanCell};
use nalgebra::{Matrix3, Vector2, Vector3};
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
    let d = [
        a.mean[0] - b.mean[0],
        a.mean[1] - b.mean[1],
        a.mean[2] - b.mean[2],
    ];
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

/// What [`crate::evaluate`] computes, cell by cell and neighbour by neighbour with 3 x 3 matrices.
///
/// Slow and plain: the oracle for the lanes.
pub fn evaluate(
    cells: &[ScanCell],
    associations: &[Association],
    pose: &Pose2,
    velocity_change: [f64; 3],
    loss: &AdaptiveLoss,
) -> NormalEquations {
    let mut sum = NormalEquations::default();
    for (scan, association) in cells.iter().zip(associations) {
        let velocity_jacobian_s = scan.velocity_jacobian_s;
        let shift = Vector3::from(velocity_change) * velocity_jacobian_s;
        let mean = Vector2::new(scan.cell.mean[0], scan.cell.mean[1]);
        let mean = mean + Vector2::new(shift.x - shift.z * mean.y, shift.y + shift.z * mean.x);
        let rotation = pose.rotation();
        let mut rotation3 = Matrix3::identity();
        rotation3.fixed_view_mut::<2, 2>(0, 0).copy_from(&rotation);
        let rotated = rotation3 * full(&scan.cell.covariance) * rotation3.transpose();
        let moved = rotation * mean + pose.translation();
        // d mean / d (x, y, yaw), perturbed on the right.
        let mut jacobian = Matrix3::zeros();
        jacobian.fixed_view_mut::<2, 2>(0, 0).copy_from(&rotation);
        jacobian
            .fixed_view_mut::<2, 1>(0, 2)
            .copy_from(&(rotation * Vector2::new(-mean.y, mean.x)));
        let turn = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let rotated_derivative = turn * rotated - rotated * turn;
        for lane in 0..association.count {
            let map_mean = Vector3::from(association.mean.map(|values| values[lane]));
            let map_covariance = full(&association.covariance.map(|values| values[lane]));
            let d = Vector3::new(moved.x, moved.y, scan.cell.mean[2]) - map_mean;
            let Some(information) = (rotated + map_covariance).try_inverse() else {
                continue;
            };
            let q = information * d;
            let s = d.dot(&q);
            let weight = loss.weight(s);
            let mut gradient = jacobian.transpose() * q;
            gradient.z -= 0.5 * q.dot(&(rotated_derivative * q));
            let hessian = jacobian.transpose() * information * jacobian * weight;
            sum.pose += hessian;
            sum.cross += hessian * velocity_jacobian_s;
            sum.velocity += hessian * (velocity_jacobian_s * velocity_jacobian_s);
            sum.pose_gradient += gradient * weight;
            sum.velocity_gradient += jacobian.transpose() * q * (weight * velocity_jacobian_s);
            sum.cost += 0.5 * loss.cost(s, weight);
            sum.weight += weight;
        }
    }
    sum
}

fn full(c: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(c[0], c[1], c[3], c[1], c[2], c[4], c[3], c[4], c[5])
}

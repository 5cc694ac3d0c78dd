//! The NDT term of a scan in pose and velocity: the robust distance to the map with its
//! derivatives.
//!
//! r^2 = d^T (R S_scan R^T + S_map)^-1 d, d = R mu_scan + t - mu_map over (x, y, intensity) (the
//! NDT term of RaNDT, III-C; the moving covariance rotates and the sum is inverted). Four
//! neighbours of one scan cell are four SIMD lanes; the tests compare with
//! [`crate::scalar::evaluate`].

use crate::{AdaptiveLoss, Association, ScanCell, scalar};
use nalgebra::{Matrix3, Vector3};
use randt_geometry::Pose2;
use randt_persist::persist;
use wide::f64x4;

/// Gauss-Newton normal equations of one scan, not yet weighted.
///
/// A cell that was measured s seconds away from the scan's instant moves with s times the
/// velocity, so its Jacobian by the velocity is s times that by the pose, and three 3 x 3 blocks
/// hold everything. Perturbations are (x, y, yaw) on the right of the pose, in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalEquations {
    /// Sum of w J^T A J.
    pub pose: Matrix3<f64>,
    /// Sum of s w J^T A J.
    pub cross: Matrix3<f64>,
    /// Sum of s^2 w J^T A J.
    pub velocity: Matrix3<f64>,
    /// Gradient by the pose.
    pub pose_gradient: Vector3<f64>,
    /// Gradient by the velocity.
    pub velocity_gradient: Vector3<f64>,
    /// Half the sum of the losses.
    pub cost: f64,
    /// Sum of the robust weights.
    pub weight: f64,
}

persist!(NormalEquations {
    pose,
    cross,
    velocity,
    pose_gradient,
    velocity_gradient,
    cost,
    weight,
});

/// Sums over cells in the world's axes; turned into the pose's frame once at the end.
#[derive(Default)]
struct Sums {
    hessian: [[f64; 6]; 3],
    gradient: [[f64; 3]; 2],
    cost: f64,
    weight: f64,
}

/// The normal equations at a pose, and at a velocity that differs by `velocity_change` (m/s, m/s,
/// rad/s in the scan's frame) from the one that the scan was de-skewed by.
pub fn evaluate(
    cells: &[ScanCell],
    associations: &[Association],
    pose: &Pose2,
    velocity_change: [f64; 3],
    loss: &AdaptiveLoss,
) -> NormalEquations {
    let mut sums = Sums::default();
    for (scan, association) in cells.iter().zip(associations) {
        if association.count > 0 {
            sums.add(scan, association, pose, velocity_change, loss);
        }
    }
    sums.into_frame_of(pose)
}

impl Sums {
    #[inline]
    fn add(
        &mut self,
        scan: &ScanCell,
        association: &Association,
        pose: &Pose2,
        velocity_change: [f64; 3],
        loss: &AdaptiveLoss,
    ) {
        let velocity_jacobian_s = scan.velocity_jacobian_s;
        let mut cell = scan.cell;
        let [x, y, _] = cell.mean;
        cell.mean[0] = x + velocity_jacobian_s * (velocity_change[0] - velocity_change[2] * y);
        cell.mean[1] = y + velocity_jacobian_s * (velocity_change[1] + velocity_change[2] * x);
        let moved = scalar::moved(&cell, pose);
        let [mxx, mxy, myy, mxi, myi, _] = moved.covariance;

        let mean = association.mean.map(f64x4::from);
        let map = association.covariance.map(f64x4::from);
        let splat = f64x4::splat;
        let [x, y, i] = moved.mean.map(splat);
        let (dx, dy, di) = (x - mean[0], y - mean[1], i - mean[2]);
        let [xx, xy, yy, xi, yi, ii] = moved.covariance.map(splat);
        let (xx, xy, yy) = (xx + map[0], xy + map[1], yy + map[2]);
        let (xi, yi, ii) = (xi + map[3], yi + map[4], ii + map[5]);

        // Inverse of the symmetric S by cofactors.
        let (a11, a12, a13) = (yy * ii - yi * yi, xi * yi - xy * ii, xy * yi - yy * xi);
        let (a22, a23, a33) = (xx * ii - xi * xi, xy * xi - xx * yi, xx * yy - xy * xy);
        let inverse = f64x4::ONE / (xx * a11 + xy * a12 + xi * a13);
        let (a11, a12, a13) = (a11 * inverse, a12 * inverse, a13 * inverse);
        let (a22, a23, a33) = (a22 * inverse, a23 * inverse, a33 * inverse);

        let qx = a11 * dx + a12 * dy + a13 * di;
        let qy = a12 * dx + a22 * dy + a23 * di;
        let qi = a13 * dx + a23 * dy + a33 * di;
        let s = dx * qx + dy * qy + di * qi;
        let in_use = f64x4::from(association.in_use);
        let weight = loss.weight4(s);
        let cost = loss.cost4(s, weight) * in_use;
        let weight = weight * in_use;

        // Half of q^T (dS/dyaw) q: the covariance turns with the scan.
        let turn = splat(mxy) * (qy * qy - qx * qx)
            + splat(mxx - myy) * qx * qy
            + (splat(mxi) * qy - splat(myi) * qx) * qi;

        // All neighbours share the scan cell's Jacobian: sum the lanes first.
        let (h11, h12, h22) = (sum(weight * a11), sum(weight * a12), sum(weight * a22));
        let (g1, g2, turn) = (sum(weight * qx), sum(weight * qy), sum(weight * turn));
        // d mean / d yaw.
        let (px, py) = (pose.y_m - moved.mean[1], moved.mean[0] - pose.x_m);
        let (h13, h23) = (h11 * px + h12 * py, h12 * px + h22 * py);
        let h33 = px * h13 + py * h23;
        let g3 = g1 * px + g2 * py;
        let hessian = [h11, h12, h22, h13, h23, h33];
        let square = velocity_jacobian_s * velocity_jacobian_s;
        let powers = [1.0, velocity_jacobian_s, square];
        for (power, sums) in powers.into_iter().zip(&mut self.hessian) {
            for (sum, h) in sums.iter_mut().zip(hessian) {
                *sum += power * h;
            }
        }
        for (sum, g) in self.gradient[0].iter_mut().zip([g1, g2, g3 - turn]) {
            *sum += g;
        }
        for (sum, g) in self.gradient[1].iter_mut().zip([g1, g2, g3]) {
            *sum += velocity_jacobian_s * g;
        }
        self.cost += 0.5 * sum(cost);
        self.weight += sum(weight);
    }

    fn into_frame_of(self, pose: &Pose2) -> NormalEquations {
        let (c, s) = pose.cos_sin();
        let rotation = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let [pose, cross, velocity] = self.hessian.map(|h| {
            rotation.transpose()
                * Matrix3::new(h[0], h[1], h[3], h[1], h[2], h[4], h[3], h[4], h[5])
                * rotation
        });
        let rotated = |g| rotation.transpose() * Vector3::from(g);
        let [pose_gradient, velocity_gradient] = self.gradient.map(rotated);
        NormalEquations {
            pose,
            cross,
            velocity,
            pose_gradient,
            velocity_gradient,
            cost: self.cost,
            weight: self.weight,
        }
    }
}

/// Sum of the lanes in a fixed order.
#[inline]
fn sum(lanes: f64x4) -> f64 {
    let [a, b, c, d] = lanes.to_array();
    (a + b) + (c + d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CellRule, Grid};
    use nalgebra::Vector2;
    use proptest::prelude::*;

    /// What [`evaluate`] computes, cell by cell and neighbour by neighbour with 3 x 3 matrices.
    ///
    /// Slow and plain: the oracle for the lanes.
    fn scalar_twin(
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

    /// A corner of two rough walls with different intensities, as map and as scan cells with
    /// derivatives by the velocity.
    fn scene() -> (Grid, Vec<ScanCell>) {
        let rule = CellRule {
            points_min: 4,
            use_intensity: true,
            cell_size_m: 0.5,
            slack: 0.0,
        };
        let mut map = Grid::new(8.0, rule);
        let mut scan = Grid::new(8.0, rule);
        for i in 0..400 {
            let s = f64::from(i) * 0.011 - 1.0;
            let rough = f64::from((i * 37) % 11) * 0.012;
            for p in [
                [s, 2.0 + rough + 0.1 * s, 9.0 + 30.0 * rough],
                [3.0 + rough, s, 20.0 - 20.0 * rough],
            ] {
                map.add(p);
                scan.add([p[0] - 0.04, p[1] + 0.03, p[2] + 0.2]);
            }
        }
        map.refresh();
        scan.refresh();
        let cells = scan
            .cells()
            .enumerate()
            .map(|(i, c)| ScanCell::new(c, -0.01 * i as f64))
            .collect();
        (map, cells)
    }

    proptest! {
        #[test]
        fn lanes_equal_the_scalar_twin(x in -0.2..0.2, y in -0.2..0.2, yaw in -0.1..0.1, v in -1.0..1.0, neighbours in 1..=4usize) {
            let (map, cells) = scene();
            let pose = Pose2::new(x, y, yaw);
            let mut associations = Vec::new();
            Association::find(&map, &cells, &pose, neighbours, &mut associations);
            let loss = AdaptiveLoss::new(-1.5, 2.0, 1.2);
            let lanes = evaluate(&cells, &associations, &pose, [v, -v, 0.3 * v], &loss);
            let twin = scalar_twin(&cells, &associations, &pose, [v, -v, 0.3 * v], &loss);
            let close = |a: &Matrix3<f64>, b: &Matrix3<f64>| (a - b).norm() <= 1e-8 * (1.0 + b.norm());
            prop_assert!(close(&lanes.pose, &twin.pose) && close(&lanes.cross, &twin.cross) && close(&lanes.velocity, &twin.velocity));
            prop_assert!((lanes.pose_gradient - twin.pose_gradient).norm() <= 1e-8 * (1.0 + twin.pose_gradient.norm()));
            prop_assert!((lanes.velocity_gradient - twin.velocity_gradient).norm() <= 1e-8 * (1.0 + twin.velocity_gradient.norm()));
            prop_assert!((lanes.cost - twin.cost).abs() <= 1e-8 * (1.0 + twin.cost));
        }

        #[test]
        fn the_gradient_is_the_derivative_of_the_cost(x in -0.2..0.2, y in -0.2..0.2, yaw in -3.0..3.0) {
            let (map, cells) = scene();
            let pose = Pose2::new(x, y, yaw);
            let mut associations = Vec::new();
            Association::find(&map, &cells, &pose, 4, &mut associations);
            let loss = AdaptiveLoss::new(-2.0, 1.5, 1.0);
            let cost = |pose: &Pose2, v: f64| evaluate(&cells, &associations, pose, [v, 0.0, 0.0], &loss).cost;
            let at = evaluate(&cells, &associations, &pose, [0.0; 3], &loss);
            let h = 1e-6;
            for axis in 0..3 {
                let mut d = Vector3::zeros();
                d[axis] = h;
                let slope = (cost(&pose.compose(&Pose2::exp(d)), 0.0) - cost(&pose.compose(&Pose2::exp(-d)), 0.0)) / (2.0 * h);
                prop_assert!((slope - at.pose_gradient[axis]).abs() < 1e-4 * (1.0 + slope.abs()), "axis {axis}: {slope} {}", at.pose_gradient[axis]);
            }
            let slope = (cost(&pose, h) - cost(&pose, -h)) / (2.0 * h);
            prop_assert!((slope - at.velocity_gradient[0]).abs() < 1e-4 * (1.0 + slope.abs()));
        }
    }
}

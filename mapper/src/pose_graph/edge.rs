//! An edge: the measured pose of one node seen from another, and how well it is known.

use super::Error;
use crate::index::KeyframeIdx;
use nalgebra::{Matrix3, Vector3};
use randt_geometry::{Pose2, elementary::wrap};

/// Farther than a robot drives (a tenth of the earth's girth); squares of it are still exact to a
/// millimetre.
pub(super) const COORDINATE_MAX_M: f64 = 4e6;

/// A measurement between two nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// The node that sees.
    pub from: KeyframeIdx,
    /// The node that is seen.
    pub to: KeyframeIdx,
    /// `to` seen from `from`.
    pub measured: Pose2,
    /// Inverse covariance of (x, y, yaw) in the frame of `to`; 1/m^2, 1/(m rad), 1/rad^2.
    pub information: Matrix3<f64>,
}

impl Edge {
    /// Refuses numbers that no measurement has.
    pub(super) fn check(&self, count: usize) -> Result<(), Error> {
        for node in [self.from.0, self.to.0] {
            if node >= count {
                return Err(Error::NoNode { node, count });
            }
        }
        if self.from == self.to {
            return Err(Error::SameNode(self.from.0));
        }
        check_pose(&self.measured)?;
        let (from, to) = (self.from.0, self.to.0);
        let bad = |what: String| Error::BadEdge { from, to, what };
        let information = &self.information;
        let asymmetry = (information - information.transpose()).amax();
        let finite = information.iter().all(|value| value.is_finite());
        if !finite || asymmetry > 1e-9 * information.amax() {
            return Err(bad(format!(
                "the information {information} is not finite and symmetric"
            )));
        }
        let is_definite = information.cholesky().is_some();
        let text = || format!("the information {information} is not positive definite");
        is_definite.then_some(()).ok_or_else(|| bad(text()))
    }

    /// (Rz^T (Ra^T (tb - ta) - tz), yaw_b - yaw_a - yaw_z): what is left of the measurement, in
    /// the frame of `to`.
    pub fn error(&self, from: &Pose2, to: &Pose2) -> Vector3<f64> {
        let seen = from.between(to);
        let (cos, sin) = self.measured.cos_sin();
        let (dx, dy) = (seen.x_m - self.measured.x_m, seen.y_m - self.measured.y_m);
        Vector3::new(
            cos * dx + sin * dy,
            -sin * dx + cos * dy,
            wrap(seen.yaw_rad - self.measured.yaw_rad),
        )
    }

    /// The same measurement from its lower node to its higher one.
    pub(super) fn forward(&self) -> Self {
        if self.from < self.to {
            return self.clone();
        }
        let carry = self.measured.inverse().adjoint();
        Self {
            from: self.to,
            to: self.from,
            measured: self.measured.inverse(),
            information: carry.transpose() * self.information * carry,
        }
    }

    /// The squared error among these poses of the graph, weighed by the information.
    pub(super) fn chi2(&self, poses: &[Pose2]) -> f64 {
        let error = self.error(&poses[self.from.0], &poses[self.to.0]);
        error.dot(&(self.information * error))
    }

    /// The derivatives of the error by perturbations on the right of both poses.
    pub(super) fn derivatives(&self, from: &Pose2, to: &Pose2) -> [Matrix3<f64>; 2] {
        let seen = from.between(to);
        let (cos, sin) = self.measured.cos_sin();
        let (u, v) = (seen.x_m, seen.y_m);
        let (x_by_yaw, y_by_yaw) = (cos * v - sin * u, -sin * v - cos * u);
        let turn = Pose2::new(0.0, 0.0, seen.yaw_rad - self.measured.yaw_rad);
        let (turn_cos, turn_sin) = turn.cos_sin();
        let by_from = Matrix3::new(
            -cos, -sin, x_by_yaw, //
            sin, -cos, y_by_yaw, //
            0.0, 0.0, -1.0,
        );
        let by_to = Matrix3::new(
            turn_cos, -turn_sin, 0.0, //
            turn_sin, turn_cos, 0.0, //
            0.0, 0.0, 1.0,
        );
        [by_from, by_to]
    }
}

/// Refuses poses that no robot has.
pub(super) fn check_pose(pose: &Pose2) -> Result<(), Error> {
    let near = |value: f64| value.abs() < COORDINATE_MAX_M;
    if near(pose.x_m) && near(pose.y_m) && pose.yaw_rad.is_finite() {
        return Ok(());
    }
    Err(Error::BadPose {
        x_m: pose.x_m,
        y_m: pose.y_m,
        yaw_rad: pose.yaw_rad,
        limit_m: COORDINATE_MAX_M,
    })
}

/// A perturbation (x, y, yaw) in the pose's own frame, as the solver steps.
pub(super) fn moved(pose: &Pose2, step: &[f64; 3]) -> Pose2 {
    pose.compose(&Pose2::from_array(*step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-20.0..20.0, -20.0..20.0, -3.1..3.1).prop_map(|(x, y, yaw)| Pose2::new(x, y, yaw))
    }

    fn edge(measured: Pose2) -> Edge {
        Edge {
            from: KeyframeIdx(0),
            to: KeyframeIdx(1),
            measured,
            information: Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 9.0),
        }
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_finite_differences(a in pose(), b in pose(), z in pose()) {
            let edge = edge(z);
            // At the cut of the angle there is no derivative.
            prop_assume!(edge.error(&a, &b).z.abs() < 3.1);
            let derivatives = edge.derivatives(&a, &b);
            let size = 1e-6;
            for axis in 0..3 {
                let step = |scale: f64| {
                    let mut step = [0.0; 3];
                    step[axis] = scale * size;
                    step
                };
                let by_from = (edge.error(&moved(&a, &step(1.0)), &b) - edge.error(&moved(&a, &step(-1.0)), &b)) / (2.0 * size);
                let by_to = (edge.error(&a, &moved(&b, &step(1.0))) - edge.error(&a, &moved(&b, &step(-1.0)))) / (2.0 * size);
                prop_assert!((by_from - derivatives[0].column(axis)).norm() < 1e-6, "from, axis {axis}");
                prop_assert!((by_to - derivatives[1].column(axis)).norm() < 1e-6, "to, axis {axis}");
            }
        }

        #[test]
        fn a_perfect_measurement_has_no_error(a in pose(), z in pose(), x in -1e-3..1e-3, yaw in -1e-3..1e-3) {
            let b = a.compose(&z);
            prop_assert!(edge(z).error(&a, &b).norm() < 1e-12);
            // The error is a perturbation on the right of the measurement.
            let error = edge(z).error(&a, &moved(&b, &[x, 0.0, yaw]));
            prop_assert!((error - Vector3::new(x, 0.0, yaw)).norm() < 1e-12);
        }
    }

    #[test]
    fn hostile_numbers_are_refused() {
        let good = edge(Pose2::new(1.0, 0.0, 0.1));
        assert!(good.check(2).is_ok());
        assert_eq!(good.check(1), Err(Error::NoNode { node: 1, count: 1 }));
        let refused = |change: fn(&mut Edge)| {
            let mut edge = good.clone();
            change(&mut edge);
            edge.check(2).unwrap_err().to_string()
        };
        assert!(refused(|e| e.to = KeyframeIdx(0)).contains("itself"));
        assert!(refused(|e| e.measured.x_m = f64::NAN).contains("NaN"));
        assert!(refused(|e| e.measured.y_m = 1e300).contains("below"));
        assert!(refused(|e| e.information[(0, 0)] = f64::INFINITY).contains("finite"));
        assert!(refused(|e| e.information[(0, 1)] = 7.0).contains("symmetric"));
        assert!(refused(|e| e.information[(2, 2)] = 0.0).contains("positive definite"));
    }
}

//! What is estimated at each scan: pose, velocity, gyro bias.

use nalgebra::{SMatrix, SVector, Vector3};
use randt_geometry::Pose2;
use randt_persist::persist;

/// Numbers in a state: x, y, yaw; forward, left, yaw rate; bias.
pub const STATE: usize = 7;
/// A perturbation of a state; that of the pose is applied on the right, in the robot's frame.
pub type StateVector = SVector<f64, STATE>;
/// Information or covariance of a perturbation.
pub type StateMatrix = SMatrix<f64, STATE, STATE>;

/// The estimate at the end of one sweep (RaNDT, III-C).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// `base_link` in `odom`.
    pub odom_from_base: Pose2,
    /// Forward m/s, left m/s, yaw rate rad/s.
    pub velocity: Vector3<f64>,
    /// Bias of the gyro's yaw rate, rad/s.
    pub bias_rad_s: f64,
}

persist!(State {
    odom_from_base,
    velocity,
    bias_rad_s
});

impl State {
    /// The state that it leads to at constant velocity.
    pub fn after(&self, dt_s: f64) -> Self {
        Self {
            odom_from_base: self
                .odom_from_base
                .compose(&Pose2::exp(self.velocity * dt_s)),
            ..*self
        }
    }

    /// This state, moved by a perturbation.
    pub fn plus(&self, step: &StateVector) -> Self {
        Self {
            odom_from_base: self
                .odom_from_base
                .compose(&Pose2::exp(step.fixed_rows::<3>(0).into_owned())),
            velocity: self.velocity + step.fixed_rows::<3>(3),
            bias_rad_s: self.bias_rad_s + step[6],
        }
    }

    /// The perturbation that leads from `origin` to this state.
    pub fn minus(&self, origin: &Self) -> StateVector {
        let mut d = StateVector::zeros();
        d.fixed_rows_mut::<3>(0)
            .copy_from(&origin.odom_from_base.between(&self.odom_from_base).log());
        d.fixed_rows_mut::<3>(3)
            .copy_from(&(self.velocity - origin.velocity));
        d[6] = self.bias_rad_s - origin.bias_rad_s;
        d
    }
}

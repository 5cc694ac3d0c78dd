//! What is known of the window's oldest state: the marginal of all that left, or the start of a
//! frame.

use super::{
    block_tridiagonal::BlockTridiagonalSystem,
    state::{State, StateMatrix},
};
use nalgebra::SVector;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_persist::persist;

/// The first pose is known by definition; this keeps the equations regular, m and rad.
const ORIGIN_SIGMA: f64 = 1e-4;
/// Sideways speed and yaw rate at a start, m/s and rad/s: a vehicle drives forward.
const START_SIDEWAYS_SIGMA: f64 = 1.0;

/// What is known of the window's oldest state from all that came before it.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// Most likely state.
    pub mean: State,
    /// Its information.
    pub information: StateMatrix,
}

persist!(Prior { mean, information });

impl Prior {
    /// At the start of a frame the pose is known by definition and the speed not at all; the
    /// gyro's bias is as it was known before, to `bias_sigma_rad_s`.
    pub fn at_start(state: &State, bias_sigma_rad_s: f64, config: &Config) -> Self {
        let odometry = &config.odometry;
        let speed = odometry.speed_max_m_s;
        let sigma = [
            ORIGIN_SIGMA,
            ORIGIN_SIGMA,
            ORIGIN_SIGMA,
            speed,
            START_SIDEWAYS_SIGMA,
            START_SIDEWAYS_SIGMA,
            bias_sigma_rad_s,
        ];
        let information = StateMatrix::from_diagonal(&SVector::from(sigma.map(|s| 1.0 / (s * s))));
        Self {
            mean: *state,
            information,
        }
    }

    /// Adds the prior to the first state of a system; gives its cost.
    pub fn add(&self, system: &mut BlockTridiagonalSystem, state: &State) -> f64 {
        let residual = state.minus(&self.mean);
        let mut jacobian = StateMatrix::identity();
        let pose = Pose2::right_jacobian_inverse(residual.fixed_rows::<3>(0).into_owned());
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose);
        let weighted = self.information * residual;
        system.add_unary(
            0,
            &(jacobian.transpose() * self.information * jacobian),
            &(jacobian.transpose() * weighted),
        );
        0.5 * residual.dot(&weighted)
    }
}

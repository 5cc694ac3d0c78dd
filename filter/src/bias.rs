//! The gyro's bias as one estimate with its covariance: a random walk that is measured now and
//! then.
//!
//! Responsible for fusing what its owner gives it, from standstills and from registered yaw. Not
//! responsible for finding either.

use crate::StandstillBias;
use nalgebra::{Matrix3, Vector3};
use randt_persist::persist;

/// Kalman filter of the three-axis bias.
///
/// ```
/// use nalgebra::Vector3;
/// use randt_filter::GyroBias;
///
/// let mut bias = GyroBias::new(0.01, 1e-4);
/// bias.advance(1.0);
/// bias.observe_along(Vector3::z(), 0.004, 0.001);
/// assert!((bias.mean_rad_s().z - 0.004).abs() < 1e-4);
/// assert_eq!(bias.mean_rad_s().x, 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct GyroBias {
    walk_rad_s_sqrt_s: f64,
    mean_rad_s: Vector3<f64>,
    covariance: Matrix3<f64>,
}

persist!(GyroBias { mean_rad_s, covariance } kept { walk_rad_s_sqrt_s });

impl GyroBias {
    /// Zero, with the standard deviation that a bias has at the start, rad/s, and its random walk,
    /// rad/s per square root of s (`odometry.gyro_bias_sigma_rad_s` and
    /// `odometry.gyro_bias_walk`).
    pub fn new(sigma_rad_s: f64, walk_rad_s_sqrt_s: f64) -> Self {
        Self {
            walk_rad_s_sqrt_s,
            mean_rad_s: Vector3::zeros(),
            covariance: Matrix3::identity() * (sigma_rad_s * sigma_rad_s),
        }
    }

    /// Starts from a bias of before, as uncertain as one that is not known: time has passed.
    pub fn start_from(&mut self, bias_rad_s: Vector3<f64>) {
        if bias_rad_s.iter().all(|b| b.is_finite()) {
            self.mean_rad_s = bias_rad_s;
        }
    }

    /// Lets time pass: the bias walks and grows uncertain.
    pub fn advance(&mut self, dt_s: f64) {
        if dt_s > 0.0 && dt_s.is_finite() {
            let grown = self.walk_rad_s_sqrt_s * self.walk_rad_s_sqrt_s * dt_s;
            self.covariance += Matrix3::identity() * grown;
        }
    }

    /// Fuses what a standstill has shown.
    pub fn observe(&mut self, standstill: &StandstillBias) {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let (bias, sigma) = (&standstill.bias_rad_s, &standstill.sigma_rad_s);
        for (axis, (&value, &sigma)) in axes.into_iter().zip(bias.iter().zip(sigma)) {
            self.observe_along(axis, value, sigma);
        }
    }

    /// Fuses the bias about one direction of the body (of length one), such as the vertical: rad/s
    /// and its standard deviation. What is not finite or claims to be exact is left out.
    pub fn observe_along(&mut self, direction: Vector3<f64>, bias_rad_s: f64, sigma_rad_s: f64) {
        let spread = self.covariance * direction;
        let variance = direction.dot(&spread) + sigma_rad_s * sigma_rad_s;
        let innovation = bias_rad_s - direction.dot(&self.mean_rad_s);
        if sigma_rad_s > 0.0 && (innovation * innovation / variance).is_finite() {
            let gain = spread / variance;
            self.mean_rad_s += gain * innovation;
            let left = self.covariance - gain * spread.transpose();
            self.covariance = (left + left.transpose()) * 0.5;
        }
    }

    /// The bias about the body's axes.
    pub fn mean_rad_s(&self) -> Vector3<f64> {
        self.mean_rad_s
    }

    /// Its standard deviation, axis by axis.
    pub fn sigma_rad_s(&self) -> Vector3<f64> {
        self.covariance.diagonal().map(|v| v.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(value: Vector3<f64>, sigma: f64) -> StandstillBias {
        StandstillBias {
            begin_ns: 0,
            end_ns: 0,
            bias_rad_s: value,
            sigma_rad_s: Vector3::repeat(sigma),
            gravity_m_s2: Vector3::zeros(),
            spread_m_s2: 0.0,
        }
    }

    #[test]
    fn equal_measurements_average_and_sharpen() {
        let mut bias = GyroBias::new(1.0, 0.0);
        bias.observe(&measured(Vector3::new(1e-3, 0.0, -1e-3), 1e-4));
        bias.observe(&measured(Vector3::new(3e-3, 0.0, -1e-3), 1e-4));
        assert!((bias.mean_rad_s() - Vector3::new(2e-3, 0.0, -1e-3)).norm() < 1e-8);
        assert!((bias.sigma_rad_s().x - 1e-4 / 2.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn time_makes_way_for_a_new_bias() {
        let mut bias = GyroBias::new(0.01, 1e-4);
        bias.observe(&measured(Vector3::zeros(), 1e-5));
        bias.advance(3600.0);
        bias.observe(&measured(Vector3::repeat(5e-3), 1e-4));
        assert!((bias.mean_rad_s() - Vector3::repeat(5e-3)).norm() < 1e-5);
    }

    #[test]
    fn nonsense_is_left_out() {
        let mut bias = GyroBias::new(0.01, 1e-4);
        let before = bias.clone();
        bias.observe_along(Vector3::z(), f64::NAN, 1e-3);
        bias.observe_along(Vector3::z(), 1e-3, 0.0);
        bias.observe_along(Vector3::repeat(f64::NAN), 1e-3, 1e-3);
        bias.advance(f64::INFINITY);
        assert_eq!(bias.mean_rad_s(), before.mean_rad_s());
        assert_eq!(bias.covariance, before.covariance);
    }
}

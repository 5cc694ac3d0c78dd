//! Information about a part of a pose, with the rest marginalised.

use nalgebra::{Matrix2, Matrix3};

/// Information about the position with yaw marginalised: the Schur complement of yaw in the
/// information of (x, y, yaw).
pub fn marginalize_yaw(information: &Matrix3<f64>) -> Matrix2<f64> {
    let h = information;
    let yaw = h.m33.max(f64::MIN_POSITIVE);
    Matrix2::new(
        h.m11 - h.m13 * h.m31 / yaw,
        h.m12 - h.m13 * h.m32 / yaw,
        h.m21 - h.m23 * h.m31 / yaw,
        h.m22 - h.m23 * h.m32 / yaw,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_inverse_of_the_positions_covariance() {
        let information = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.7, 0.5, -0.7, 2.0);
        let covariance = information.try_inverse().unwrap();
        let position = covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let product = marginalize_yaw(&information) * position;
        assert!((product - Matrix2::identity()).norm() < 1e-12);
    }

    #[test]
    fn without_any_information_it_is_zero() {
        assert_eq!(marginalize_yaw(&Matrix3::zeros()), Matrix2::zeros());
    }
}

//! Relative poses with their covariances.

use super::super::Edge;
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// A relative pose and the covariance of a perturbation on its right.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Uncertain {
    pub pose: Pose2,
    pub covariance: Matrix3<f64>,
}

impl Uncertain {
    /// Nothing between a node and itself.
    pub const NOWHERE: Self = Self {
        pose: Pose2::IDENTITY,
        covariance: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// What an edge measured.
    pub fn from_edge(edge: &Edge) -> Option<Self> {
        Some(Self {
            pose: edge.measured,
            covariance: edge.information.try_inverse()?,
        })
    }

    /// `self`, then `next`, whose errors are independent.
    pub fn compose(&self, next: &Self) -> Self {
        let carry = next.pose.inverse().adjoint();
        Self {
            pose: self.pose.compose(&next.pose),
            covariance: carry * self.covariance * carry.transpose() + next.covariance,
        }
    }

    /// The way back.
    pub fn inverse(&self) -> Self {
        let carry = self.pose.adjoint();
        Self {
            pose: self.pose.inverse(),
            covariance: carry * self.covariance * carry.transpose(),
        }
    }

    /// How far a measurement is from it, with both their covariances.
    pub fn innovation(&self, edge: &Edge) -> Innovation {
        let error = edge.error(&Pose2::IDENTITY, &self.pose);
        let covariance = self.covariance + edge.information.try_inverse().unwrap_or_default();
        let weighed = covariance.try_inverse();
        Innovation {
            chi2: weighed.map_or(f64::INFINITY, |weighed| error.dot(&(weighed * error))),
            volume: covariance.determinant().max(0.0).sqrt(),
        }
    }
}

/// What a measurement says else than the estimate.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Innovation {
    /// Squared, by both covariances: chi2 of three degrees of freedom.
    pub chi2: f64,
    /// Product of the standard deviations along the axes of both covariances' sum, m^2 rad.
    pub volume: f64,
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::edge;
    use super::*;

    fn step(pose: Pose2, sigmas: [f64; 3]) -> Uncertain {
        Uncertain {
            pose,
            covariance: Matrix3::from_diagonal(&sigmas.map(|s| s * s).into()),
        }
    }

    #[test]
    fn a_heading_off_at_the_start_is_a_position_off_at_the_end() {
        let turned = step(Pose2::IDENTITY, [0.0, 0.0, 0.01]);
        let straight = step(Pose2::new(10.0, 0.0, 0.0), [0.0; 3]);
        let covariance = turned.compose(&straight).covariance;
        assert!((covariance[(1, 1)].sqrt() - 0.1).abs() < 1e-12);
        assert!(
            covariance[(0, 0)].abs() < 1e-12 && (covariance[(2, 2)].sqrt() - 0.01).abs() < 1e-12
        );
    }

    #[test]
    fn the_way_back_and_forth_is_the_same() {
        let way = step(Pose2::new(2.0, -1.0, 2.5), [0.1, 0.2, 0.03]);
        let again = way.inverse().inverse();
        assert!((again.covariance - way.covariance).amax() < 1e-15);
        assert!(way.compose(&way.inverse()).pose.translation().norm() < 1e-12);
    }

    #[test]
    fn an_innovation_counts_in_standard_deviations_of_both() {
        let measured = edge(0, 1, Pose2::new(1.0, 0.0, 0.0));
        // 5 cm of the measurement and 12 cm of the estimate are 13 cm.
        let seen = step(Pose2::new(1.39, 0.0, 0.0), [0.12, 0.12, 0.1]);
        let innovation = seen.innovation(&measured);
        assert!((innovation.chi2 - 9.0).abs() < 1e-9);
        let yaw = (1.0_f64 / 365.0 + 0.01).sqrt();
        assert!((innovation.volume - 0.13 * 0.13 * yaw).abs() < 1e-9);
        // What is known exactly leaves the measurement's own error.
        let exact = Uncertain {
            pose: Pose2::new(1.05, 0.0, 0.0),
            ..Uncertain::NOWHERE
        };
        assert!((exact.innovation(&measured).chi2 - 1.0).abs() < 1e-9);
    }
}

//! Relative poses with their covariances.

use super::super::Edge;
use nalgebra::{Matrix3, Vector3};
use randt_geometry::Pose2;

/// A relative pose and the covariance of a perturbation on its right.
#[derive(Clone, Copy, Debug)]
pub(super) struct Uncertain {
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
    pub fn of(edge: &Edge) -> Option<Self> {
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

    /// How far a measurement is from it, with both their covariances: chi2 of three degrees of freedom.
    pub fn disagreement(&self, edge: &Edge) -> f64 {
        let error = error(edge, &self.pose);
        let weighed =
            (self.covariance + edge.information.try_inverse().unwrap_or_default()).try_inverse();
        weighed.map_or(f64::INFINITY, |weighed| error.dot(&(weighed * error)))
    }
}

fn error(edge: &Edge, seen: &Pose2) -> Vector3<f64> {
    edge.error(&Pose2::IDENTITY, seen)
}

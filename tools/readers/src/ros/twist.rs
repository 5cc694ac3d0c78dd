//! Velocities: `nav_msgs/Odometry`, `geometry_msgs/TwistStamped`,
//! `geometry_msgs/TwistWithCovarianceStamped`.

use super::recording::{Channel, Kind};
use super::topics::named;
use super::wire::{Encoding, Malformed, RosHeader, Wire};
use crate::Error;
use std::path::Path;

/// Forward, left, yaw among the six axes of a twist.
const PLANE: [usize; 3] = [0, 1, 5];
const AXES: usize = 6;

/// Which of the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TwistKind {
    /// Pose and twist; the pose is the sum of the twists, and is not used.
    Odometry,
    Plain,
    WithCovariance,
}

/// A velocity of the robot in the plane.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RosTwist {
    pub header: RosHeader,
    /// Forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// Row by row; 0 where it is not known.
    pub covariance: [f64; 9],
}

impl RosTwist {
    pub fn decode(bytes: &[u8], encoding: Encoding, kind: TwistKind) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        if kind == TwistKind::Odometry {
            wire.string()?; // the frame that moves
            wire.f64s::<7>()?; // pose
            wire.f64s::<36>()?; // its covariance
        }
        let twist = wire.f64s::<AXES>()?;
        let mut covariance = [0.0; 9];
        if kind != TwistKind::Plain {
            let all = wire.f64s::<36>()?;
            for (value, (row, column)) in covariance.iter_mut().zip(
                PLANE
                    .iter()
                    .flat_map(|row| PLANE.map(|column| (row, column))),
            ) {
                *value = all.get(row * AXES + column).copied().unwrap_or_default();
            }
        }
        Ok(Self {
            header,
            velocity: PLANE.map(|axis| twist.get(axis).copied().unwrap_or_default()),
            covariance,
        })
    }
}

/// The topic of twists that was asked for.
pub(super) fn find_twist(
    channels: &[Channel],
    wanted: Option<&str>,
    path: &Path,
) -> Result<Option<usize>, Error> {
    let Some(topic) = wanted else {
        return Ok(None);
    };
    let is_twist = |channel: &Channel| matches!(channel.kind, Kind::Twist(_));
    let kinds = "nav_msgs/Odometry, geometry_msgs/TwistStamped or TwistWithCovarianceStamped";
    named(channels, is_twist, topic, path, (kinds, "--twist-topic")).map(Some)
}

//! What odometry says of the keyframes: a step from one to the next, and where a submap holds
//! them.

use super::{Edge, position_sigma_m};
use crate::index::KeyframeIdx;
use crate::keyframe::{KeyframeStore, MapKeyframe};
use nalgebra::Matrix3;
use randt_config::Config;

/// Least standard deviations of a step of odometry, m and rad: a covariance of zero would make the
/// graph stiff.
const STEP_SIGMA_MIN: [f64; 3] = [1e-3, 1e-3, 1e-4];

/// How well a keyframe's position is known from its submap's root: at least, and per metre of
/// distance, m. Simulated drives show 0.015 m + 0.004 a metre where a submap grows, one room much
/// less than that. The graph takes intra-submap constraints and steps for independent though both
/// are of the same odometry: sharper than this, it turns true loops of the tunnel away.
const SUBMAP_SIGMA_M: [f64; 2] = [0.015, 0.003];
/// Of the heading it says next to nothing, rad: the heading seen from the root is the sum of the
/// steps between, which the graph has, and errors of headings do add up within a submap. Counted
/// twice, the map was surer of headings than it was right by a factor of two to four.
const SUBMAP_SIGMA_RAD: f64 = 0.1;
/// Variance of a heading that many steps add, in terms of what each of them says: over 128 steps
/// of 25 drives in five worlds headings are off by 0.015 to 0.018 rad, and 0.012 is said with
/// `loops.odometry_covariance_factor`. Neighbouring steps share their errors.
const HEADING_GROWTH: f64 = 1.75;

/// Its submap holds a keyframe whose step is this sure in every direction, m: half of them.
const INTRA_SUBMAP_SIGMA_MAX_M: f64 = 0.02;

/// How steps of odometry become constraints.
pub(super) struct Steps {
    covariance_factor: f64,
}

impl Steps {
    /// As it is configured.
    pub fn new(config: &Config) -> Self {
        Self {
            covariance_factor: config.loops.odometry_covariance_factor,
        }
    }

    /// Odometry's step to a keyframe that comes next, where it is of the same frame.
    pub fn to(&self, keyframe: &MapKeyframe, keyframes: &KeyframeStore) -> Option<Edge> {
        let (from, before) = keyframes.newest().zip(keyframes.last())?;
        let mut covariance = keyframe.step_covariance * self.covariance_factor;
        covariance.m33 *= HEADING_GROWTH;
        (before.odom_frame_id == keyframe.odom_frame_id).then(|| Edge {
            from,
            to: KeyframeIdx(keyframes.len()),
            measured: before.odom_from_base.between(&keyframe.odom_from_base),
            information: step_information(&covariance),
        })
    }
}

/// Holds a keyframe that comes next by the root of the submap that odometry registered it to:
/// within a submap errors do not add up as those of its steps would.
pub(super) fn intra_submap_constraint(
    keyframe: &MapKeyframe,
    keyframes: &KeyframeStore,
) -> Option<Edge> {
    let to = KeyframeIdx(keyframes.len());
    let from = keyframes.find(keyframe.submap_root)?;
    let root = keyframes.get(from.0)?;
    // The step before is this constraint already, and another frame has none.
    if from.0 + 1 >= to.0 || root.odom_frame_id != keyframe.odom_frame_id {
        return None;
    }
    // Along a bare wall the scan did not hold on to the submap: errors do add up there.
    if position_sigma_m(&keyframe.step_covariance) > INTRA_SUBMAP_SIGMA_MAX_M {
        return None;
    }
    let measured = root.odom_from_base.between(&keyframe.odom_from_base);
    let distance_m = measured.translation().norm();
    let [least, per_m] = SUBMAP_SIGMA_M;
    let position = least + per_m * distance_m;
    let information = [position, position, SUBMAP_SIGMA_RAD].map(|sigma| 1.0 / (sigma * sigma));
    Some(Edge {
        from,
        to,
        measured,
        information: Matrix3::from_diagonal(&information.into()),
    })
}

/// Information of a step from its covariance, with floors; not finite ones count as unknown.
fn step_information(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&STEP_SIGMA_MIN.map(|sigma| sigma * sigma).into());
    let symmetric = (covariance + covariance.transpose()) * 0.5 + floor;
    let inverse = symmetric.cholesky().map(|cholesky| cholesky.inverse());
    let information = inverse.filter(|i| i.iter().all(|value| value.is_finite()));
    information.map_or_else(Matrix3::identity, |i| (i + i.transpose()) * 0.5)
}

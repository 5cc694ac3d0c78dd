//! A keyframe becomes a place, and a node that edges of odometry hold.

use super::Mapper;
use crate::{Place, graph::Edge, verify::position_sigma_m};
use nalgebra::Matrix3;
use randt_messages::{Keyframe, KeyframeHead, MessageRef};

/// Least standard deviations of a step of odometry, m and rad: a covariance of nothing would make the graph stiff.
const STEP_SIGMA_MIN: [f64; 3] = [1e-3, 1e-3, 1e-4];

/// How well a keyframe is known from its submap's root: at least, and per metre of distance (m and rad). Simulated drives
/// show 0.015 m + 0.004 a metre and 0.002 rad + 0.0006 a metre where a submap grows, one room much less than that. The
/// graph takes ties and steps for independent though both are of the same odometry: sharper than this, it turns true
/// loops of the tunnel away.
const SUBMAP_SIGMA_M: [f64; 2] = [0.015, 0.003];
const SUBMAP_SIGMA_RAD: [f64; 2] = [0.003, 0.0003];

/// A keyframe is tied to its submap where its step is this sure in every direction, m: half of the keyframes in building
/// and yard.
const TIED_SIGMA_MAX_M: f64 = 0.02;

impl Mapper {
    /// Adds place and node; `false` where the keyframe cannot be one.
    pub(super) fn add(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        if !self.is_next(keyframe.head) {
            return false;
        }
        let place = Place::new(keyframe, self.places.last());
        let node = match self.step_to(&place) {
            Some(edge) => self.graph.append(edge),
            // A frame's own coordinates, until a loop joins it.
            None => self.graph.add_node(place.odom),
        };
        if node.is_ok() {
            if let Some(edge) = self.tie_to(&place) {
                // Both nodes are there and the numbers are good: the chain's edge was accepted.
                let _ = self.graph.add_odometry(edge);
            }
            self.places.push(place);
        }
        node.is_ok()
    }

    /// Lets the newest place into submaps and search.
    pub(super) fn enter(&mut self) {
        self.submaps.push(&self.places);
        if let Some(place) = self.places.last()
            && self.config.loops.enabled
        {
            self.search.push(place);
        }
    }

    /// Whether a keyframe can follow those that are there; others would be left out.
    pub fn is_next(&self, head: &KeyframeHead) -> bool {
        // A clock that was set back opens a new frame of odometry.
        let rises = self.places.last().is_none_or(|before| {
            head.id > before.keyframe_id
                && (head.odom_frame_id > before.odom_frame_id
                    || head.odom_frame_id == before.odom_frame_id
                        && head.header.stamp_ns > before.stamp_ns)
        });
        rises && head.pose.iter().all(|value| value.is_finite())
    }

    /// Odometry's step to a place that comes next, where it is of the same frame.
    pub(super) fn step_to(&self, place: &Place) -> Option<Edge> {
        let before = self.places.last()?;
        let to = self.places.len();
        let factor = self.config.loops.odometry_covariance_factor;
        (before.odom_frame_id == place.odom_frame_id).then(|| Edge {
            from: to - 1,
            to,
            measured: before.odom.between(&place.odom),
            information: step_information(&(place.step_covariance * factor)),
        })
    }

    /// Ties a place that comes next to the root of the submap that odometry registered it to: within a submap errors do
    /// not add up as those of its steps would.
    pub(super) fn tie_to(&self, place: &Place) -> Option<Edge> {
        let to = self.places.len();
        let root = self
            .places
            .binary_search_by_key(&place.submap_root, |other| other.keyframe_id);
        let from = root.ok()?;
        let root = self.places.get(from)?;
        // The step before says that already, or another frame has nothing to say.
        if from + 1 >= to || root.odom_frame_id != place.odom_frame_id {
            return None;
        }
        // Along a bare wall the scan did not hold on to the submap: errors do add up there.
        if position_sigma_m(&place.step_covariance) > TIED_SIGMA_MAX_M {
            return None;
        }
        let measured = root.odom.between(&place.odom);
        let distance_m = measured.translation().norm();
        let sigma = |[least, per_m]: [f64; 2]| least + per_m * distance_m;
        let (position, yaw) = (sigma(SUBMAP_SIGMA_M), sigma(SUBMAP_SIGMA_RAD));
        let information = [position, position, yaw].map(|sigma| 1.0 / (sigma * sigma));
        Some(Edge {
            from,
            to,
            measured,
            information: Matrix3::from_diagonal(&information.into()),
        })
    }
}

/// Information of a step from its covariance, with floors; not finite ones count as unknown.
fn step_information(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&STEP_SIGMA_MIN.map(|sigma| sigma * sigma).into());
    let symmetric = (covariance + covariance.transpose()) * 0.5 + floor;
    let information = symmetric.cholesky().map(|cholesky| cholesky.inverse());
    let information = information.filter(|i| i.iter().all(|value| value.is_finite()));
    information.map_or_else(Matrix3::identity, |i| (i + i.transpose()) * 0.5)
}

//! The live state as its message.

use super::{Odometry, Sink};
use crate::{heading::Heading, state::StateMatrix, trust::position_information, window::Solution};
use nalgebra::{Matrix3, Vector3};
use randt_messages::{ImuUse, OdometryState, PoseRecord, Trust};

/// Stands for "anywhere" where there is no solution, m^2 and rad^2.
const UNKNOWN_VARIANCE: f64 = 1e6;

impl Odometry {
    /// Publishes the newest state.
    pub(super) fn publish(
        &mut self,
        solution: &Option<Solution>,
        imu_use: ImuUse,
        sink: &mut impl Sink,
    ) {
        let Some(slot) = self.used.checked_sub(1).and_then(|i| self.slots.get(i)) else {
            return;
        };
        let first_of_frame = self.used == 1 && self.settled.is_none();
        let covariance = match solution {
            Some(solution) => solution.covariance,
            // The origin is where the first scan stands.
            None if first_of_frame => StateMatrix::zeros(),
            None => StateMatrix::identity() * UNKNOWN_VARIANCE,
        };
        let trust = match solution {
            Some(solution) => self.judge.judge(solution, slot, &self.config),
            None => Trust::Degraded,
        };
        if trust != Trust::Good && !first_of_frame {
            self.counters.scans_unsupported += 1;
        }
        self.frame.lost = trust == Trust::Lost;
        let mut state = OdometryState::default();
        state.header.sequence = self.sequence;
        state.header.stamp_ns = slot.scan.head.header.stamp_ns;
        state.id = self.sequence;
        state.scan_sequence = slot.scan.head.scan_sequence;
        state.scan_epoch = slot.scan.head.scan_epoch;
        state.scan_published_ns = slot.scan.head.scan_published_ns;
        state.odom_frame_id = self.frame.id;
        state.pose = slot.state.pose.to_array();
        if let Some((stamp_ns, pose)) = self.leaving.take() {
            state.settled_stamp_ns = stamp_ns;
            state.settled_pose = pose.to_array();
        }
        state.velocity = slot.state.velocity.into();
        let bias = self
            .heading
            .as_ref()
            .map_or_else(Vector3::zeros, Heading::bias_rad_s);
        state.gyro_bias_rad_s = [bias.x, bias.y, slot.state.bias_rad_s];
        state.attitude = self
            .heading
            .as_ref()
            .map(Heading::attitude)
            .unwrap_or_default()
            .to_array();
        let pose_covariance: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        for (value, covariance) in state
            .covariance
            .iter_mut()
            .zip(pose_covariance.transpose().iter())
        {
            *value = *covariance;
        }
        let solution = solution.unwrap_or_default();
        state.information_eigenvalues = position_information(&solution);
        state.cost = solution.cost;
        state.imu_sequence = u64::MAX;
        if let Some(newest) = self.heading.as_ref().and_then(Heading::newest) {
            state.imu_sequence = newest.sequence;
            state.imu_epoch = newest.epoch;
            state.imu_published_ns = newest.published_ns;
        }
        state.imu_use = imu_use as u32;
        state.trust = trust as u32;
        state.points = slot.points.len() as u32;
        state.cells = slot.cells.len() as u32;
        // A weight above 1/2 is within the loss's scale.
        state.inliers = slot
            .associations
            .iter()
            .filter(|a| {
                a.nearest < self.config.odometry.loss_scale * self.config.odometry.loss_scale
            })
            .count() as u32;
        state.iterations = solution.iterations;
        state.submap_id = self.submaps.active().id;
        self.sequence += 1;
        self.record = record(&state);
        sink.state(&state);
    }
}

/// What of a state another process can go on from.
fn record(state: &OdometryState) -> PoseRecord {
    PoseRecord {
        stamp_ns: state.header.stamp_ns,
        scan_epoch: state.scan_epoch,
        scan_sequence: state.scan_sequence,
        pose: state.pose,
        velocity: state.velocity,
        gyro_bias_rad_s: state.gyro_bias_rad_s,
        attitude: state.attitude,
        covariance: state.covariance,
        ..PoseRecord::default()
    }
}

//! Keyframes: scans with their final pose, by distance and angle, none at standstill.

use crate::slot::Slot;
use nalgebra::{Matrix3, Vector3};
use randt_config::{Config, Keyframe as KeyframeConfig};
use randt_geometry::{Pose2, elementary::wrap};
use randt_messages::{Keyframe, KeyframeBeam, KeyframePoint, MAX_BEAMS, Message};
use randt_persist::persist;

/// Chooses keyframes and fills their messages.
#[derive(Debug)]
pub struct KeyframeMaker {
    config: KeyframeConfig,
    last: Option<Pose2>,
    next_id: u64,
    has_made: bool,
    /// Covariance of the pose since the last keyframe, in the present robot's frame.
    covariance: Matrix3<f64>,
    message: Message<Keyframe>,
}

persist!(KeyframeMaker {
    last,
    next_id,
    has_made,
    covariance,
} kept {
    config,
    message,
} sound has_room);

impl KeyframeMaker {
    /// None made yet.
    pub fn new(config: &KeyframeConfig) -> Self {
        Self {
            config: config.clone(),
            last: None,
            next_id: 0,
            has_made: false,
            covariance: Matrix3::zeros(),
            message: Message::default(),
        }
    }

    /// A new odometry frame: the next scan is a keyframe, numbers go on.
    pub fn restart(&mut self) {
        self.last = None;
        self.covariance = Matrix3::zeros();
    }

    /// Whether there are numbers left.
    fn has_room(&self) -> bool {
        self.next_id <= u64::MAX / 2
    }

    /// Numbers go on from here, as long as none was given.
    pub fn continue_from(&mut self, next_id: u64) {
        if !self.has_made {
            self.next_id = next_id;
        }
    }

    /// Whether one was made.
    pub fn has_made(&self) -> bool {
        self.has_made
    }

    /// Number of the next keyframe.
    pub fn next_id(&self) -> u64 {
        self.next_id
    }

    /// Moves the covariance on by one step whose own noise is `step`: in the new frame, Ad^-1 P Ad^-T + Q.
    pub fn propagate(&mut self, relative: &Pose2, step: &Matrix3<f64>) {
        let adjoint = relative.inverse().adjoint();
        self.covariance = adjoint * self.covariance * adjoint.transpose() + step;
    }

    /// Whether a scan at this pose is a keyframe.
    pub fn is_due(&self, pose: &Pose2) -> bool {
        self.last.is_none_or(|last| {
            last.between(pose).translation().norm() >= self.config.distance_m
                || wrap(pose.yaw_rad - last.yaw_rad).abs() >= self.config.angle_rad
        })
    }

    /// Fills the message of the next keyframe.
    pub fn make(
        &mut self,
        slot: &Slot,
        odom_frame_id: u64,
        submap: (u64, u64),
    ) -> &Message<Keyframe> {
        let (head, items) = (&mut *self.message.head, &mut self.message.items);
        head.header.sequence = self.next_id;
        head.header.stamp_ns = slot.scan.head.header.stamp_ns;
        head.id = self.next_id;
        head.odom_frame_id = odom_frame_id;
        (head.submap_id, head.submap_root) = submap;
        head.scan_sequence = slot.scan.head.scan_sequence;
        head.pose = slot.state.pose.to_array();
        for (i, value) in head.covariance.iter_mut().enumerate() {
            *value = self
                .covariance
                .get((i / 3, i % 3))
                .copied()
                .unwrap_or_default();
        }
        head.twist = slot.state.velocity.into();
        head.beam_count = slot.beams.len().min(MAX_BEAMS) as u32;
        head.beams.fill(KeyframeBeam::default());
        let total = slot.scan.items.len();
        for (i, (out, beam)) in head.beams.iter_mut().zip(&slot.beams).enumerate() {
            *out = KeyframeBeam {
                x_m: beam.origin.x as f32,
                y_m: beam.origin.y as f32,
                azimuth_rad: randt_geometry::elementary::atan2(beam.direction.y, beam.direction.x)
                    as f32,
                first_point: slot.scan.head.sweep.returns_of(i, total).start as u32,
            };
        }
        items.clear();
        items.extend(slot.points.iter().map(|p| KeyframePoint {
            x_m: p.x_m as f32,
            y_m: p.y_m as f32,
            intensity: p.intensity as f32,
            beam: p.beam,
            reserved: 0,
        }));
        self.next_id += 1;
        self.has_made = true;
        self.last = Some(slot.state.pose);
        self.covariance = Matrix3::zeros();
        &self.message
    }
}

/// Covariance of one step's relative pose: what the scan itself says, with the motion model where it is silent.
pub fn step_covariance(slot: &Slot, config: &Config) -> Matrix3<f64> {
    let odometry = &config.odometry;
    let dt = slot.dt_s.max(1e-3);
    let sigma = [
        odometry.acceleration_sigma_m_s2 * dt * dt,
        odometry.lateral_acceleration_sigma_m_s2 * dt * dt,
        odometry.gyro_noise_rad_s_sqrt_hz * dt.sqrt(),
    ];
    // Diagonal and positive: the sum is invertible whatever the scan says.
    let motion = Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| 1.0 / (s * s))));
    (slot.scan_information(config) + motion)
        .try_inverse()
        .unwrap_or_default()
}

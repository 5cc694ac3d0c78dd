//! Keyframes: scans with their final pose, by distance and angle, none at standstill.

use crate::sliding_window::WindowScan;
use nalgebra::{Matrix3, Vector3};
use randt_config::{Config, Keyframe as KeyframeConfig};
use randt_geometry::{Pose2, elementary::wrap};
use randt_messages::{Keyframe, KeyframeBeam, KeyframePoint, MAX_BEAMS, Message};
use randt_persist::persist;

/// Selects keyframes and fills their messages.
#[derive(Debug)]
pub struct KeyframeSelector {
    config: KeyframeConfig,
    odom_from_last: Option<Pose2>,
    next_id: u64,
    has_made: bool,
    /// Covariance of the pose since the last keyframe, in the present robot's frame.
    covariance: Matrix3<f64>,
    message: Message<Keyframe>,
}

persist!(KeyframeSelector {
    odom_from_last,
    next_id,
    has_made,
    covariance,
} kept {
    config,
    message,
} sound has_room);

impl KeyframeSelector {
    /// None made yet.
    pub fn new(config: &KeyframeConfig) -> Self {
        Self {
            config: config.clone(),
            odom_from_last: None,
            next_id: 0,
            has_made: false,
            covariance: Matrix3::zeros(),
            message: Message::default(),
        }
    }

    /// A new odometry frame: the next scan is a keyframe, numbers go on.
    pub fn restart(&mut self) {
        self.odom_from_last = None;
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

    /// Moves the covariance on by one step whose own noise is `step`: in the new frame, Ad^-1 P
    /// Ad^-T + Q.
    pub fn propagate(&mut self, last_from_base: &Pose2, step: &Matrix3<f64>) {
        let adjoint = last_from_base.inverse().adjoint();
        self.covariance = adjoint * self.covariance * adjoint.transpose() + step;
    }

    /// Whether a scan at this pose is a keyframe.
    pub fn is_due(&self, odom_from_base: &Pose2) -> bool {
        self.odom_from_last.is_none_or(|last| {
            last.between(odom_from_base).translation().norm() >= self.config.distance_m
                || wrap(odom_from_base.yaw_rad - last.yaw_rad).abs() >= self.config.angle_rad
        })
    }

    /// Fills the message of the next keyframe.
    pub fn make(
        &mut self,
        scan: &WindowScan,
        odom_frame_id: u64,
        submap: (u64, u64),
    ) -> &Message<Keyframe> {
        let (head, items) = (&mut *self.message.head, &mut self.message.items);
        head.header.sequence = self.next_id;
        head.header.stamp_ns = scan.message.head.header.stamp_ns;
        head.id = self.next_id;
        head.odom_frame_id = odom_frame_id;
        (head.submap_id, head.submap_root) = submap;
        head.scan_sequence = scan.message.head.scan_sequence;
        head.pose = scan.state.odom_from_base.to_array();
        for (i, value) in head.covariance.iter_mut().enumerate() {
            *value = self
                .covariance
                .get((i / 3, i % 3))
                .copied()
                .unwrap_or_default();
        }
        head.twist = scan.state.velocity.into();
        head.weak_direction_rad = scan.status.weak_direction_rad;
        head.trust = scan.status.trust;
        head.trust_reasons = scan.status.reasons;
        head.localizability = scan.status.localizability;
        head.beam_count = scan.beams.len().min(MAX_BEAMS) as u32;
        head.beams.fill(KeyframeBeam::default());
        let total = scan.message.items.len();
        for (i, (out, beam)) in head.beams.iter_mut().zip(&scan.beams).enumerate() {
            *out = KeyframeBeam {
                x_m: beam.origin.x as f32,
                y_m: beam.origin.y as f32,
                azimuth_rad: randt_geometry::elementary::atan2(beam.direction.y, beam.direction.x)
                    as f32,
                first_point: scan.message.head.sweep.returns_of(i, total).start as u32,
            };
        }
        items.clear();
        items.extend(scan.points.iter().map(|p| KeyframePoint {
            x_m: p.x_m as f32,
            y_m: p.y_m as f32,
            intensity: p.intensity as f32,
            beam: p.beam,
            reserved: 0,
        }));
        self.next_id += 1;
        self.has_made = true;
        self.odom_from_last = Some(scan.state.odom_from_base);
        self.covariance = Matrix3::zeros();
        &self.message
    }
}

/// Covariance of one step's relative pose: the information of the scan itself, with the motion
/// model where it has none and the drift of a direction that it does not see.
pub fn step_covariance(scan: &WindowScan, config: &Config) -> Matrix3<f64> {
    let odometry = &config.odometry;
    let dt = scan.dt_s.max(1e-3);
    let sigma = [
        odometry.acceleration_sigma_m_s2 * dt * dt,
        odometry.lateral_acceleration_sigma_m_s2 * dt * dt,
        odometry.gyro_noise_rad_s_sqrt_hz * dt.sqrt(),
    ];
    // Diagonal and positive: the sum is invertible for every scan.
    let motion = Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| 1.0 / (s * s))));
    let information = scan.scan_information(config) + motion;
    let mut covariance = information.try_inverse().unwrap_or_default();
    let mut position = covariance.fixed_view_mut::<2, 2>(0, 0);
    position += scan.drift_covariance();
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_persist::{Persist, Reader, Writer};

    fn scan_at(x_m: f64, yaw_rad: f64) -> WindowScan {
        let mut scan = WindowScan::default();
        scan.state.odom_from_base = Pose2::new(x_m, 0.0, yaw_rad);
        scan
    }

    #[test]
    fn keyframes_come_by_distance_and_angle_and_are_numbered() {
        let config = KeyframeConfig::default();
        let mut selector = KeyframeSelector::new(&config);
        let near = 0.99 * config.distance_m;
        for (x_m, yaw_rad, expected) in [
            (0.0, 0.0, true),
            (near, 0.0, false),
            (1.01 * config.distance_m, 0.0, true),
            (1.01 * config.distance_m, 1.01 * config.angle_rad, true),
        ] {
            let scan = scan_at(x_m, yaw_rad);
            assert_eq!(
                selector.is_due(&scan.state.odom_from_base),
                expected,
                "{x_m} {yaw_rad}"
            );
            if expected {
                let id = selector.next_id();
                assert_eq!(selector.make(&scan, 5, (6, 7)).head.id, id);
            }
        }
        assert_eq!(selector.next_id(), 3);
        // Numbers go on in a new frame, and once one was given they cannot be moved.
        selector.restart();
        selector.continue_from(70);
        assert!(selector.is_due(&Pose2::IDENTITY) && selector.next_id() == 3);
    }

    #[test]
    fn it_survives_its_process() {
        let config = KeyframeConfig::default();
        let mut whole = KeyframeSelector::new(&config);
        whole.make(&scan_at(1.0, 0.0), 0, (0, 0));
        whole.propagate(&Pose2::new(0.1, 0.0, 0.0), &Matrix3::identity());
        let mut bytes = [0; 256];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = KeyframeSelector::new(&config);
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.covariance, whole.covariance);
        assert_eq!(restored.odom_from_last, whole.odom_from_last);
        assert!(restored.has_made() && restored.next_id() == 1);
    }
}

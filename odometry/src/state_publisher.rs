//! The live state as its message.

use crate::{
    Sink,
    gyro_integrator::GyroIntegrator,
    localizability::{CELLS_MIN, position_information},
    sliding_window::{Solution, WindowScan},
    tracking_monitor::TrackingMonitor,
};
use nalgebra::{Matrix3, Vector3};
use randt_geometry::Pose2;
use randt_messages::{ImuUse, OdometryState, PoseRecord};
use randt_persist::{Error, Persist, Reader, Writer};

/// Variance of a frame's first pose, m^2 and rad^2.
const ORIGIN_VARIANCE: f64 = 1e-8;
/// Variance of a pose without a solution, m^2 and rad^2.
const UNKNOWN_VARIANCE: f64 = 1e6;

/// What one scan's estimate gave.
#[derive(Debug)]
pub struct Estimate<'a> {
    /// The newest scan of the window.
    pub scan: &'a WindowScan,
    /// The window's solution.
    pub solution: Option<Solution>,
    /// Whether the scan is the first one of its frame: it is at the origin by definition.
    pub is_first_of_frame: bool,
    /// Whether its frame has not begun: it has no pose.
    pub is_waiting: bool,
    /// How the IMU was used.
    pub imu_use: ImuUse,
    /// What the position has drifted by.
    pub tracking: &'a TrackingMonitor,
    /// The odometry frame.
    pub odom_frame_id: u64,
    /// The submap that it was registered to.
    pub submap_id: u64,
    /// Squared distance below which a cell of the scan has a close counterpart: its robust weight
    /// is above 1/2.
    pub inlier_max: f64,
}

/// Fills and numbers the states.
#[derive(Clone, Copy, Debug, Default)]
pub struct StatePublisher {
    /// Number of the next state.
    sequence: u64,
    /// The last state, as far as another process can go on from it alone.
    record: PoseRecord,
    /// The scan that left the window since the last state: stamp and final pose in `odom`.
    retired_scan: Option<(i64, Pose2)>,
}

impl StatePublisher {
    /// Continues after a record.
    pub fn continue_from(&mut self, sequence: u64, record: &PoseRecord) {
        (self.sequence, self.record) = (sequence, *record);
    }

    /// Number of the next state.
    pub fn next_id(&self) -> u64 {
        self.sequence
    }

    /// What of the last state another process can go on from.
    pub fn record(&self) -> &PoseRecord {
        &self.record
    }

    /// The scan that leaves the window, or none: it goes out with the next state.
    pub fn set_retired_scan(&mut self, retired: Option<(i64, Pose2)>) {
        self.retired_scan = retired;
    }

    /// Publishes the newest state.
    pub fn publish(
        &mut self,
        estimate: &Estimate<'_>,
        gyro: Option<&GyroIntegrator>,
        sink: &mut impl Sink,
    ) {
        let (scan, head) = (estimate.scan, &estimate.scan.message.head);
        let mut state = OdometryState::default();
        state.header.sequence = self.sequence;
        state.header.stamp_ns = head.header.stamp_ns;
        state.id = self.sequence;
        state.scan_sequence = head.scan_sequence;
        state.scan_epoch = head.scan_epoch;
        state.scan_published_ns = head.scan_published_ns;
        state.odom_frame_id = estimate.odom_frame_id;
        state.pose = scan.state.odom_from_base.to_array();
        if let Some((stamp_ns, pose)) = self.retired_scan.take() {
            state.retired_stamp_ns = stamp_ns;
            state.retired_pose = pose.to_array();
        }
        state.velocity = scan.state.velocity.into();
        let bias = gyro.map_or_else(Vector3::zeros, GyroIntegrator::bias_rad_s);
        state.gyro_bias_rad_s = [bias.x, bias.y, scan.state.bias_rad_s];
        let attitude = gyro.map(GyroIntegrator::attitude).unwrap_or_default();
        state.attitude = attitude.to_array();
        let covariance = pose_covariance(estimate);
        for (value, covariance) in state
            .covariance
            .iter_mut()
            .zip(covariance.transpose().iter())
        {
            *value = *covariance;
        }
        let solution = estimate.solution.unwrap_or_default();
        state.information_eigenvalues = position_information(&solution.scan_information);
        state.weak_direction_rad = scan.status.weak_direction_rad;
        state.fit = solution.fit;
        state.cost = solution.cost;
        state.imu_sequence = u64::MAX;
        if let Some(newest) = gyro.and_then(GyroIntegrator::newest) {
            state.imu_sequence = newest.sequence;
            state.imu_epoch = newest.epoch;
            state.imu_published_ns = newest.published_ns;
        }
        state.imu_use = estimate.imu_use as u32;
        state.trust = scan.status.trust;
        state.trust_reasons = scan.status.reasons;
        state.localizability = scan.status.localizability;
        state.points = scan.points.len() as u32;
        state.cells = scan.cells.len() as u32;
        let nearest = scan.associations.iter().map(|a| a.nearest);
        state.inliers = nearest.filter(|d| *d < estimate.inlier_max).count() as u32;
        state.iterations = solution.iterations;
        state.submap_id = estimate.submap_id;
        self.sequence += 1;
        self.record = record_of(&state);
        sink.state(&state);
    }
}

impl Persist for StatePublisher {
    fn save(&self, out: &mut Writer<'_>) {
        let Self {
            sequence,
            record,
            retired_scan,
        } = self;
        sequence.save(out);
        out.plain(record);
        retired_scan.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.sequence.restore(from)?;
        self.record = from.plain()?;
        self.retired_scan.restore(from)
    }
}

/// Covariance of x, y, yaw against the submap, in the robot's frame, with the drift of the last
/// metres.
fn pose_covariance(estimate: &Estimate<'_>) -> Matrix3<f64> {
    let scan = estimate.scan;
    // The first scan defines the origin, as the window's prior has it; one of too few cells is not
    // the first.
    let is_origin = estimate.is_first_of_frame && scan.cells.len() >= CELLS_MIN;
    let solution = match &estimate.solution {
        Some(solution) if !estimate.is_waiting => solution,
        None if is_origin && !estimate.is_waiting => return Matrix3::identity() * ORIGIN_VARIANCE,
        _ => return Matrix3::identity() * UNKNOWN_VARIANCE,
    };
    let mut covariance = solution.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let position = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let widened = (estimate.tracking).widen(&position, &scan.state.odom_from_base);
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&widened);
    covariance
}

/// What of a state another process can go on from.
fn record_of(state: &OdometryState) -> PoseRecord {
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

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{Keyframe, MessageRef};
    use randt_ndt::ScanCell;

    #[derive(Default)]
    struct States(Vec<OdometryState>);

    impl Sink for States {
        fn state(&mut self, state: &OdometryState) {
            self.0.push(*state);
        }
        fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
    }

    fn estimate<'a>(
        scan: &'a WindowScan,
        tracking: &'a TrackingMonitor,
        is_first_of_frame: bool,
    ) -> Estimate<'a> {
        Estimate {
            scan,
            solution: None,
            is_first_of_frame,
            is_waiting: false,
            imu_use: ImuUse::None,
            tracking,
            odom_frame_id: 3,
            submap_id: 4,
            inlier_max: 4.0,
        }
    }

    #[test]
    fn states_are_numbered_and_a_retired_scan_goes_out_once() {
        let (mut scan, mut states) = (WindowScan::default(), States::default());
        scan.cells = vec![ScanCell::default(); CELLS_MIN];
        let tracking = TrackingMonitor::default();
        let mut publisher = StatePublisher::default();
        publisher.continue_from(7, &PoseRecord::default());
        publisher.set_retired_scan(Some((99, Pose2::new(1.0, 2.0, 0.5))));
        publisher.publish(&estimate(&scan, &tracking, true), None, &mut states);
        publisher.publish(&estimate(&scan, &tracking, false), None, &mut states);
        let ids = states.0.iter().map(|state| state.id);
        assert!(ids.eq([7, 8]) && publisher.next_id() == 9);
        let [first, second] = &states.0[..] else {
            panic!("two states")
        };
        assert_eq!((first.retired_stamp_ns, second.retired_stamp_ns), (99, 0));
        // The first scan's pose is exact by definition, another one's without a solution unknown.
        assert_eq!((first.covariance[0], second.covariance[0]), (1e-8, 1e6));
    }

    #[test]
    fn it_survives_its_process() {
        let mut whole = StatePublisher::default();
        whole.continue_from(7, &PoseRecord::default());
        whole.set_retired_scan(Some((99, Pose2::new(1.0, 2.0, 0.5))));
        let mut bytes = [0; 1024];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = StatePublisher::default();
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.next_id(), 7);
        assert_eq!(restored.record(), whole.record());
        assert_eq!(restored.retired_scan, whole.retired_scan);
    }
}

//! `odometry/state`: where the robot is, how fast, how sure, after each sweep.

use crate::{Header, layout::coded, plain};

coded! {
    /// How far the pose can be believed.
    pub enum Trust {
        /// The estimate has no support in the data; the next scan opens a new odom frame.
        #[default]
        Lost = 0 => "lost",
        /// Some direction is held by the motion model or IMU alone, the scans fit their map
        /// poorly, or beams of two senders came.
        Degraded = 1 => "degraded",
        /// The scan fixes the pose in every direction.
        Good = 2 => "good",
    }

    /// Which directions of the position the scan sees by itself.
    pub enum Localizability {
        /// Not judged: there was nothing to set the scan against, or an earlier build wrote it.
        #[default]
        Unknown = 0 => "unknown",
        /// All.
        Full = 1 => "full",
        /// One direction is not seen.
        Partial = 2 => "partial",
        /// None is seen.
        None = 3 => "none",
    }

    /// How the IMU was used for a scan.
    pub enum ImuUse {
        /// Samples cover the sweep to its end.
        Covered = 0 => "covered",
        /// Samples end before the sweep does: the bounded wait ran out.
        Late = 1 => "late",
        /// No IMU for this scan.
        #[default]
        None = 2 => "none",
    }
}

plain! {
    /// The live estimate at the end of one sweep. Frame `odom` to `base_link`.
    pub struct OdometryState {
        /// Stamp: the sweep's end.
        pub header: Header,
        /// From 0, without gaps over restarts: a state that is sent twice keeps its number.
        pub id: u64,
        /// Sequence of the scan.
        pub scan_sequence: u64,
        /// Epoch of the scan.
        pub scan_epoch: u64,
        /// New whenever odometry starts without its past or declares itself lost.
        pub odom_frame_id: u64,
        /// x m, y m, yaw rad in `odom`.
        pub pose: [f64; 3],
        /// The scan that left the window with this one, by its stamp; 0 where none did.
        #[was(settled_stamp_ns)]
        pub retired_stamp_ns: i64,
        /// Its final pose in `odom`: x m, y m, yaw rad.
        #[was(settled_pose)]
        pub retired_pose: [f64; 3],
        /// Forward m/s, left m/s, yaw rate rad/s in `base_link`.
        pub velocity: [f64; 3],
        /// Gyro bias about the IMU's x, y, z, rad/s.
        pub gyro_bias_rad_s: [f64; 3],
        /// `base_link` in a level frame of the same yaw-free heading: quaternion w, x, y, z.
        pub attitude: [f64; 4],
        /// Covariance of x, y, yaw against the submap that the scan is registered to, in the frame
        /// of `base_link` (perturbation on the right), row by row, with the drift of the last five
        /// metres; m^2, m rad, rad^2. 1e6 where there is no pose. What submaps are off in `odom`
        /// is in the keyframes' covariances.
        pub covariance: [f64; 9],
        /// Eigenvalues of the scans' own position information, 1/m^2, smaller first.
        pub information_eigenvalues: [f64; 2],
        /// The direction that the scan does not see, in `base_link`, from -pi/2 to pi/2; 0 unless
        /// the localizability is partial.
        pub weak_direction_rad: f64,
        /// Mean robust weight of the scan's correspondences, 0..1.
        pub fit: f64,
        /// Robust cost of the solution.
        pub cost: f64,
        /// Sequence of the last IMU sample that was used; `u64::MAX` where none was.
        pub imu_sequence: u64,
        /// Epoch of that sample.
        pub imu_epoch: u64,
        /// When the scan was published, for diagnosis only.
        pub scan_published_ns: i64,
        /// When that last sample was published, for diagnosis only.
        pub imu_published_ns: i64,
        /// An [`ImuUse`] as its code.
        #[code(ImuUse)]
        pub imu_use: u32,
        /// A [`Trust`] as its code.
        #[code(Trust)]
        pub trust: u32,
        /// Why the trust is not good: a set of [`TrustReason`](crate::TrustReason), a bit each.
        pub trust_reasons: u32,
        /// A [`Localizability`] as its code.
        #[code(Localizability)]
        pub localizability: u32,
        /// Points of the scan.
        pub points: u32,
        /// NDT cells of the scan.
        pub cells: u32,
        /// Cells of the scan with a close counterpart in the submap.
        pub inliers: u32,
        /// Gauss-Newton iterations; 0 without a solution.
        pub iterations: u32,
        /// Submap that the scan was registered to.
        pub submap_id: u64,
    }
}

impl OdometryState {
    /// How far the pose can be believed.
    pub fn trust(&self) -> Trust {
        Trust::from_code(self.trust)
    }

    /// Which directions of the position the scan sees by itself.
    pub fn localizability(&self) -> Localizability {
        Localizability::from_code(self.localizability)
    }

    /// The direction that the scan does not see, where that is one.
    pub fn weak_direction(&self) -> Option<f64> {
        let is_partial = self.localizability() == Localizability::Partial;
        is_partial.then_some(self.weak_direction_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trust_is_decoded_as_it_was_encoded_and_an_unknown_code_is_lost() {
        for trust in [Trust::Lost, Trust::Degraded, Trust::Good] {
            assert_eq!(Trust::from_code(trust as u32), trust);
        }
        assert_eq!(Trust::from_code(7), Trust::Lost);
        let state = OdometryState {
            trust: 1,
            ..Default::default()
        };
        assert_eq!(state.trust().as_str(), "degraded");
    }
}

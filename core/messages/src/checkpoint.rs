//! What a stage keeps outside its process for its next process. Not on the bus.

use crate::plain;

plain! {
    /// Where odometry is and how far it has counted: small, and valid for every build with this
    /// layout. It is used where the whole state cannot be taken over.
    pub struct PoseRecord {
        /// End of the last scan's sweep.
        pub stamp_ns: i64,
        /// Epoch of that scan.
        pub scan_epoch: u64,
        /// Sequence of that scan.
        pub scan_sequence: u64,
        /// Frame of `pose`.
        pub odom_frame_id: u64,
        /// x m, y m, yaw rad in `odom`.
        pub pose: [f64; 3],
        /// Forward m/s, left m/s, yaw rate rad/s in `base_link`.
        pub velocity: [f64; 3],
        /// Gyro bias about the IMU's x, y, z, rad/s.
        pub gyro_bias_rad_s: [f64; 3],
        /// `base_link` in a level frame of the same yaw-free heading: quaternion w, x, y, z.
        pub attitude: [f64; 4],
        /// Covariance of x, y, yaw in the frame of `base_link`, row by row.
        pub covariance: [f64; 9],
        /// Id of the next state.
        pub next_state: u64,
        /// Id of the next keyframe.
        pub next_keyframe: u64,
        /// Id of the next submap.
        pub next_submap: u64,
    }

    /// The last message of a publisher that is in the recorder's files.
    pub struct LastRecorded {
        /// Name of the topic, in UTF-8, filled with zeros.
        pub topic: [u8; 32],
        /// The stage that published it, where several stages write the topic; else zero.
        pub writer: [u8; 16],
        /// Epoch of the publisher.
        pub epoch: u64,
        /// Sequence in that epoch.
        pub sequence: u64,
        /// Number that continues over restarts of the publisher, as that of states and keyframes
        /// does; else 0.
        pub id: u64,
        /// When it was published, ns.
        pub published_ns: i64,
    }
}

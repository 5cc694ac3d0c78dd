//! `odometry/keyframe`: a scan with its final pose, de-skewed, for the mapper.

use crate::{Header, Localizability, MAX_BEAMS, Trust, plain};

plain! {
    /// Where a beam began and looked, in the keyframe's `base_link` at the sweep's end.
    pub struct KeyframeBeam {
        /// Origin, m.
        pub x_m: f32,
        /// Origin, m.
        pub y_m: f32,
        /// Direction, rad.
        pub azimuth_rad: f32,
        /// Index of the beam's first point.
        pub first_point: u32,
    }

    /// A de-skewed return in the keyframe's `base_link` at the sweep's end.
    pub struct KeyframePoint {
        /// Forward, m.
        pub x_m: f32,
        /// Left, m.
        pub y_m: f32,
        /// In the sensor's unit.
        pub intensity: f32,
        /// Index of its beam.
        pub beam: u16,
        /// Zero.
        pub reserved: u16,
    }

    /// The fixed part of a keyframe.
    pub struct KeyframeHead {
        /// Stamp: the sweep's end.
        pub header: Header,
        /// From 0, without gaps over restarts.
        pub id: u64,
        /// Frame of `pose`.
        pub odom_frame_id: u64,
        /// Submap that it belongs to.
        pub submap_id: u64,
        /// Keyframe that is the submap's root.
        pub submap_root: u64,
        /// Sequence of the scan.
        pub scan_sequence: u64,
        /// x m, y m, yaw rad in `odom`, final.
        pub pose: [f64; 3],
        /// Covariance relative to the previous keyframe, in this one's `base_link`, row by row.
        pub covariance: [f64; 9],
        /// Forward m/s, left m/s, yaw rate rad/s.
        pub twist: [f64; 3],
        /// The direction that the scan did not see, as in the state of the scan.
        pub weak_direction_rad: f64,
        /// The [`Trust`] of the scan as its code, as it was judged live. It says nothing where the
        /// localizability is unknown.
        #[code(Trust)]
        pub trust: u32,
        /// Why it was not good: a set of [`TrustReason`](crate::TrustReason).
        #[was(reserved)]
        pub trust_reasons: u32,
        /// The [`Localizability`] of the scan as its code.
        #[code(Localizability)]
        pub localizability: u32,
        /// Beams in the table.
        pub beam_count: u32,
        /// The table; entries from `beam_count` on are zero.
        pub beams: [KeyframeBeam; MAX_BEAMS],
    }
}

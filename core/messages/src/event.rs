//! What a drive gives, of its sensors and of the truth, one thing after the other.

use crate::{ImuSample, Message, RadarScan, TruthPose, Twist};

/// One thing of a drive, recorded or simulated.
#[derive(Clone, Debug)]
pub enum Event {
    /// A whole sweep, at its end.
    Scan(Message<RadarScan>),
    /// A reading of the IMU.
    Imu(ImuSample),
    /// How fast the robot moves by its wheels.
    Twist(Twist),
    /// Where the robot truly is, for evaluation only. The truth of a simulated sweep's end comes
    /// with the sweep's stamp (that of a radar that is not late), before the sweep.
    Truth(TruthPose),
}

impl Event {
    /// The stamp by which events are ordered; a scan's is its sweep's end.
    pub fn stamp_ns(&self) -> i64 {
        match self {
            Self::Scan(scan) => scan.head.header.stamp_ns,
            Self::Imu(sample) => sample.header.stamp_ns,
            Self::Twist(twist) => twist.header.stamp_ns,
            Self::Truth(pose) => pose.header.stamp_ns,
        }
    }
}

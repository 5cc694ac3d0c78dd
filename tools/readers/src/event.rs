//! One thing that a log holds.

use randt_messages::{ImuSample, Message, RadarScan, TruthPose};

/// One message of a log.
#[derive(Debug)]
pub enum Event {
    /// A whole sweep.
    Scan(Message<RadarScan>),
    /// A reading of the IMU.
    Imu(ImuSample),
    /// The truth of a simulated log; evaluation only.
    Truth(TruthPose),
}

impl Event {
    /// The stamp by which events are ordered; a scan's is its sweep's end.
    pub fn stamp_ns(&self) -> i64 {
        match self {
            Self::Scan(scan) => scan.head.header.stamp_ns,
            Self::Imu(sample) => sample.header.stamp_ns,
            Self::Truth(pose) => pose.header.stamp_ns,
        }
    }
}

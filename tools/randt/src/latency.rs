//! How old a pose is when it is published: the wait for its data, and the computation.

use randt_messages::{ImuUse, OdometryState};

/// A log's stamps are farther than this from the clock by which it is played.
const LIVE_MAX_NS: i64 = 10_000_000_000;

/// The two parts of a pose's age.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// From the end of the sweep to the covering IMU sample on the bus.
    pub wait_ns: i64,
    /// From the later of scan and covering sample on the bus to the state on the bus.
    pub compute_ns: i64,
}

impl Latency {
    /// Of one state; `None` where no sample covered its sweep.
    pub fn of(state: &OdometryState) -> Option<Self> {
        if state.imu_use != ImuUse::Covered as u32 {
            return None;
        }
        let (scan_ns, imu_ns) = (state.scan_published_ns, state.imu_published_ns);
        // A player sends a scan when its sweep ends, by a clock that is not that of the stamps.
        let live = (scan_ns - state.header.stamp_ns).abs() < LIVE_MAX_NS;
        let end_ns = if live { state.header.stamp_ns } else { scan_ns };
        Some(Self {
            wait_ns: (imu_ns - end_ns).max(0),
            compute_ns: state.header.published_ns - scan_ns.max(imu_ns),
        })
    }
}

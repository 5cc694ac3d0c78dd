//! How long a scan takes from the end of its sweep to its pose.

use randt_messages::{ImuUse, OdometryState};
use serde::Serialize;
use std::collections::VecDeque;

/// States that the figures speak of.
const STATES: usize = 200;
/// A stamp that is farther from the time of publishing is another clock's: a log that is played.
const SAME_CLOCK_NS: i64 = 10_000_000_000;

/// The time of one state, in its two parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latency {
    /// From the end of the sweep until the IMU covered it: what no computer can hasten.
    pub wait_ms: f64,
    /// From the last thing that was needed until the state was published: filter, bus and
    /// odometry.
    pub compute_ms: f64,
}

impl Latency {
    /// Of a state, where it used the IMU.
    pub fn from_state(state: &OdometryState) -> Option<Self> {
        let (scan_ns, imu_ns) = (state.scan_published_ns, state.imu_published_ns);
        // A sample that did not cover the sweep came before its end, or long ago.
        if scan_ns == 0 || imu_ns == 0 || state.imu_use != ImuUse::Covered as u32 {
            return None;
        }
        let stamp_ns = state.header.stamp_ns;
        let wait_ns = if scan_ns.abs_diff(stamp_ns) < SAME_CLOCK_NS.unsigned_abs() {
            imu_ns - stamp_ns
        } else {
            // A scan is played when its sweep ends.
            (imu_ns - scan_ns).max(0)
        };
        let compute_ns = state.header.published_ns - scan_ns.max(imu_ns);
        Some(Self {
            wait_ms: wait_ns as f64 * 1e-6,
            compute_ms: compute_ns as f64 * 1e-6,
        })
    }
}

/// The latencies of the last states.
#[derive(Debug, Default)]
pub struct Latencies {
    last: VecDeque<Latency>,
    /// Odometry frame and stamp of the newest state.
    newest: Option<(u64, i64)>,
}

/// Medians and 99th percentiles, ms; none where there were no states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LatencyFigures {
    /// See [`Latency::wait_ms`].
    pub wait_p50: Option<f64>,
    /// See [`Latency::wait_ms`].
    pub wait_p99: Option<f64>,
    /// See [`Latency::compute_ms`].
    pub compute_p50: Option<f64>,
    /// See [`Latency::compute_ms`].
    pub compute_p99: Option<f64>,
}

impl Latencies {
    /// Takes a state. One that was sent before is left out: odometry that came back sends its last
    /// ones again.
    pub fn push(&mut self, state: &OdometryState) {
        let (frame, stamp_ns) = (state.odom_frame_id, state.header.stamp_ns);
        let is_known = |(newest, last_ns)| newest == frame && stamp_ns <= last_ns;
        if self.newest.is_some_and(is_known) {
            return;
        }
        self.newest = Some((frame, stamp_ns));
        if let Some(latency) = Latency::from_state(state) {
            if self.last.len() == STATES {
                self.last.pop_front();
            }
            self.last.push_back(latency);
        }
    }

    /// The figures of the last states.
    pub fn figures(&self) -> LatencyFigures {
        let sorted = |part: fn(&Latency) -> f64| {
            let mut values: Vec<f64> = self.last.iter().map(part).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let wait = sorted(|latency| latency.wait_ms);
        let compute = sorted(|latency| latency.compute_ms);
        LatencyFigures {
            wait_p50: percentile(&wait, 50),
            wait_p99: percentile(&wait, 99),
            compute_p50: percentile(&compute, 50),
            compute_p99: percentile(&compute, 99),
        }
    }
}

/// The smallest of the sorted values that at least this percentage of them do not exceed.
pub fn percentile(sorted: &[f64], percent: usize) -> Option<f64> {
    let rank = (sorted.len() * percent).div_ceil(100).max(1);
    sorted.get(rank - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    /// Published at 100 s of the clock; scan, IMU and state by their ms after the end of the
    /// sweep.
    fn state(stamp_ns: i64, [scan, imu, published]: [i64; 3]) -> OdometryState {
        let ns = |ms: i64| 100 * SECOND + ms * 1_000_000;
        let mut state = OdometryState {
            scan_published_ns: ns(scan),
            imu_published_ns: ns(imu),
            ..OdometryState::default()
        };
        state.header.stamp_ns = stamp_ns;
        state.header.published_ns = ns(published);
        state
    }

    #[test]
    fn a_percentile_is_one_of_the_values() {
        assert_eq!(percentile(&[], 50), None);
        assert_eq!(percentile(&[3.0], 99), Some(3.0));
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!(percentile(&values, 50), Some(100.0));
        assert_eq!(percentile(&values, 99), Some(198.0));
        assert_eq!(percentile(&values, 0), Some(1.0));
        assert_eq!(percentile(&values, 100), Some(200.0));
    }

    #[test]
    fn waiting_ends_with_the_imu_and_computing_begins_with_the_later_of_both() {
        let latency = |stamp_ns, times| {
            Latency::from_state(&state(stamp_ns, times)).map(|l| (l.wait_ms, l.compute_ms))
        };
        // Live: the scan needs 40 ms to come, the IMU 6.
        assert_eq!(latency(100 * SECOND, [40, 6, 43]), Some((6.0, 3.0)));
        assert_eq!(latency(100 * SECOND, [2, 6, 43]), Some((6.0, 37.0)));
        // Played: the stamps are years away.
        assert_eq!(latency(7, [40, 44, 47]), Some((4.0, 3.0)));
        assert_eq!(latency(7, [40, 36, 47]), Some((0.0, 7.0)));
        let mut blind = state(7, [40, 36, 47]);
        blind.imu_published_ns = 0;
        assert_eq!(Latency::from_state(&blind), None);
    }

    #[test]
    fn a_state_counts_once_and_old_ones_go() {
        let mut latencies = Latencies::default();
        assert_eq!(latencies.figures(), LatencyFigures::default());
        for stamp_ns in 0..500 {
            let slow = if stamp_ns < 300 { 90 } else { 3 };
            let state = state(stamp_ns, [0, 1, 1 + slow]);
            latencies.push(&state);
            latencies.push(&state);
        }
        let figures = latencies.figures();
        assert_eq!(latencies.last.len(), STATES);
        assert_eq!(figures.wait_p50, Some(1.0));
        assert_eq!(figures.compute_p99, Some(3.0));
        // A new frame begins anew, wherever its stamps are.
        let mut anew = state(0, [0, 1, 51]);
        anew.odom_frame_id = 1;
        latencies.push(&anew);
        assert_eq!(latencies.figures().compute_p99, Some(3.0));
        assert_eq!(latencies.last.back().map(|l| l.compute_ms), Some(50.0));
    }
}

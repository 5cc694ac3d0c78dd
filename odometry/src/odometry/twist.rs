//! Wheels, where the robot has them: they hold the way that the scans do not fix.

use super::{Odometry, Sink};
use crate::{
    gyro_measurement::GyroMeasurement, sliding_window::Solution, synchronizer::MessageId,
    twist_speed::Lie,
};
use randt_messages::Twist;

/// What a standstill shows of the gyro's bias is of this many windows of its detector at most.
const STANDSTILL_WINDOWS: f64 = 1.5;

impl Odometry {
    /// Takes a twist; scans that waited for it are processed. Where none come nothing waits.
    pub fn push_twist(&mut self, twist: &Twist, sink: &mut impl Sink) {
        if self.config.odometry.use_twist {
            (self.synchronizer).push_twist(twist, &mut self.counters);
            self.process_covered(sink);
        }
    }

    /// The last twist that was pushed.
    pub fn last_twist(&self) -> Option<MessageId> {
        self.synchronizer.last_twist()
    }

    /// Integrates the oldest of the waiting twists.
    pub(super) fn integrate_twists(&mut self, twists: usize) {
        for _ in 0..twists {
            let Some(twist) = self.synchronizer.pop_twist() else {
                return;
            };
            self.twist.push(&twist);
        }
    }

    /// Gives the newest scan the way by wheels since the one before, which ended at `last_end_ns`.
    pub(super) fn predict_by_twist(&mut self, last_end_ns: Option<i64>, gyro: &GyroMeasurement) {
        let (Some(last_end_ns), Some(end_ns)) = (last_end_ns, self.window.last_end_ns()) else {
            return;
        };
        let turn_rad = gyro.term.map(|term| {
            let since_s = (end_ns - last_end_ns) as f64 * 1e-9;
            term.turn.angle_rad - gyro.bias_rad_s * since_s
        });
        let inertial = self.gyro.as_ref().map(|gyro| gyro.inertial_speed());
        // An IMU that does not agree with the radar is no judge of wheels.
        let gained_m_s = inertial
            .filter(|speed| gyro.covers_sweep && !speed.disagrees())
            .and_then(|speed| speed.gained_m_s());
        let lie = (self.twist).advance(last_end_ns, end_ns, turn_rad, gained_m_s);
        self.refuse_twists(lie);
        self.window.predict_by_twist(self.twist.way());
        let standstill_s = STANDSTILL_WINDOWS * self.config.attitude.standstill_window_s;
        if self.twist.has_rolled(standstill_s) {
            self.window.leave_out_standstill();
        }
        let is_refused = self.twist.is_measured() && self.twist.is_refused();
        self.counters.scans_twist_refused += u64::from(is_refused);
    }

    /// Sets wheels against where the radar has the newest scan.
    pub(super) fn observe_twist(&mut self, solution: Option<&Solution>) {
        let Some(newest) = self.window.newest() else {
            return;
        };
        let way = newest.twist_way().filter(|_| solution.is_some());
        self.counters.scans_by_twist += u64::from(way.is_some());
        if let Some((way, gyro)) = way.zip(self.gyro.as_mut()) {
            gyro.observe_wheels(way.way_m.map(|way_m| way_m / newest.dt_s));
        }
        let fix = solution.and_then(|solution| newest.radar_fix(&solution.covariance));
        let lie = self.twist.observe_scan(fix.map(|fix| fix.pose));
        self.refuse_twists(lie);
    }

    /// Where wheels were wrong, what they said goes out of the window too.
    fn refuse_twists(&mut self, lie: Option<Lie>) {
        let Some((lie, end_ns)) = lie.zip(self.window.last_end_ns()) else {
            return;
        };
        self.window.leave_out_twists();
        if self.counters.twist_refused_first_ns == 0 {
            self.counters.twist_refused_first_ns = end_ns;
            self.counters.twist_refused_mm_s = (1e3 * lie.wheels_m_s) as i64;
            self.counters.twist_true_mm_s = (1e3 * lie.truth_m_s) as i64;
        }
    }
}

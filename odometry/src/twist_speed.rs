//! The way that wheels measure between two scans, as far as they can be believed.

mod twist_integrator;
mod twist_monitor;

use crate::sliding_window::TwistWay;
use randt_geometry::Pose2;
use randt_messages::Twist;
use randt_persist::persist;
use twist_integrator::{MeasuredWay, TwistIntegrator};
use twist_monitor::TwistMonitor;

pub use twist_monitor::Lie;

/// Speed of wheels that do not stand, m/s: above their noise.
const ROLLING_M_S: f64 = 0.05;

/// Wheels, or whatever else measures the robot's velocity.
#[derive(Clone, Debug)]
pub struct TwistSpeed {
    integrator: TwistIntegrator,
    monitor: TwistMonitor,
    /// What was measured since the last scan, and the turn in that time, rad.
    newest: Option<(MeasuredWay, f64)>,
    /// Time for which they have stood, s.
    stood_s: f64,
}

persist!(TwistSpeed {
    integrator,
    monitor,
    newest,
    stood_s
});

impl TwistSpeed {
    /// Nothing known yet.
    pub fn new() -> Self {
        Self {
            integrator: TwistIntegrator::new(),
            monitor: TwistMonitor::new(),
            newest: None,
            stood_s: 0.0,
        }
    }

    /// Another frame begins.
    pub fn restart(&mut self) {
        self.monitor.restart();
        self.newest = None;
    }

    /// Takes a twist.
    pub fn push(&mut self, twist: &Twist) {
        self.integrator.push(twist);
    }

    /// Twists that went back in time or repeated a stamp.
    pub fn rejected(&self) -> u64 {
        self.integrator.rejected
    }

    /// A scan ends, the one before it did at `last_end_ns`. `turn_rad` and `gained_m_s`: turn and
    /// change of speed by the IMU. Gives what wheels said where the IMU does not agree.
    pub fn advance(
        &mut self,
        last_end_ns: i64,
        end_ns: i64,
        turn_rad: Option<f64>,
        gained_m_s: Option<f64>,
    ) -> Option<Lie> {
        let measured = self.integrator.between(last_end_ns, end_ns);
        self.integrator.forget_before(last_end_ns);
        self.newest = measured.map(|way| (way, turn_rad.unwrap_or(way.turn_rad)));
        let speed_m_s = measured.map(|way| way.speed_m_s().abs());
        self.stood_s = match (speed_m_s, &measured) {
            (Some(speed_m_s), Some(way)) if speed_m_s < ROLLING_M_S => self.stood_s + way.dt_s,
            _ => 0.0,
        };
        self.monitor.observe_change(measured.as_ref(), gained_m_s)
    }

    /// Whether twists cover the time since the last scan.
    pub fn is_measured(&self) -> bool {
        self.newest.is_some()
    }

    /// Whether wheels are not believed since they were wrong.
    pub fn is_refused(&self) -> bool {
        self.monitor.are_refused()
    }

    /// Whether wheels that can be believed were rolling within the last seconds.
    pub fn has_rolled(&self, within_s: f64) -> bool {
        self.way().is_some() && self.stood_s < within_s
    }

    /// The way since the last scan, where wheels can be believed.
    pub fn way(&self) -> Option<TwistWay> {
        let (measured, turn_rad) = self.newest.as_ref()?;
        self.monitor.way(measured, *turn_rad)
    }

    /// A scan was estimated: where the radar has it, if it fixes the way. Gives what wheels said
    /// where the radar does not agree.
    pub fn observe_scan(&mut self, fix: Option<Pose2>) -> Option<Lie> {
        self.monitor.observe_scan(self.newest.as_ref(), fix)
    }
}

//! The way that wheels have measured, as a function of time, from twists as they come.

use crate::stamps::{STAMPS_NS, is_set_back};
use randt_messages::Twist;
use randt_persist::persist;
use std::collections::VecDeque;

/// Twists kept: over 2 s at 200 Hz, more than the time between two scans.
const CAPACITY: usize = 512;
/// A hole in the twists above this is not bridged by a straight line, ns.
const HOLE_NS: i64 = 250_000_000;
/// The last twist holds for this long, ns: one of 10 Hz.
const HELD_NS: i64 = 100_000_000;
/// Standard deviation of a speed whose covariance is unknown, m/s.
const UNKNOWN_SIGMA_M_S: f64 = 0.02;

/// What is integrated up to one twist.
#[derive(Clone, Copy, Debug, Default)]
struct TwistState {
    stamp_ns: i64,
    /// Way forward and to the left, m, and turn, rad.
    integral: [f64; 3],
    velocity: [f64; 3],
    sigma_m_s: [f64; 2],
}

/// What wheels measured between two instants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeasuredWay {
    /// Way forward and to the left, m.
    pub way_m: [f64; 2],
    /// Turn, rad.
    pub turn_rad: f64,
    /// Time, s.
    pub dt_s: f64,
    /// What its sender says of a speed, one standard deviation, m/s.
    pub sigma_m_s: [f64; 2],
}

impl MeasuredWay {
    /// Mean speed forward, m/s.
    pub fn speed_m_s(&self) -> f64 {
        self.way_m[0] / self.dt_s
    }
}

persist!(TwistState {
    stamp_ns,
    integral,
    velocity,
    sigma_m_s
});
persist!(MeasuredWay {
    way_m,
    turn_rad,
    dt_s,
    sigma_m_s
});

/// Integrates twists.
#[derive(Clone, Debug)]
pub struct TwistIntegrator {
    states: VecDeque<TwistState>,
    /// Twists that went back in time or repeated a stamp.
    pub rejected: u64,
}

persist!(TwistIntegrator {
    states,
    rejected
} sound is_sound);

impl TwistIntegrator {
    /// Nothing known yet.
    pub fn new() -> Self {
        Self {
            states: VecDeque::with_capacity(CAPACITY),
            rejected: 0,
        }
    }

    /// Whether the states are in order, of stamps that leave room for sums.
    fn is_sound(&self) -> bool {
        let stamps = self.states.iter().map(|state| state.stamp_ns);
        stamps.clone().all(|t| STAMPS_NS.contains(&t))
            && stamps.is_sorted_by(|a, b| a < b)
            && self.states.len() <= CAPACITY
            && self.rejected <= u64::MAX / 2
    }

    /// Integrates a twist.
    pub fn push(&mut self, twist: &Twist) {
        let stamp_ns = twist.header.stamp_ns;
        let last = self.states.back().copied();
        let last = match last {
            Some(last) if is_set_back(stamp_ns, last.stamp_ns) => {
                self.states.clear();
                None
            }
            last => last,
        };
        if last.is_some_and(|last| stamp_ns <= last.stamp_ns) {
            self.rejected += 1;
            return;
        }
        let integral = last.map_or([0.0; 3], |last| {
            let half_s = 0.5e-9 * (stamp_ns - last.stamp_ns) as f64;
            std::array::from_fn(|axis| {
                last.integral[axis] + half_s * (last.velocity[axis] + twist.velocity[axis])
            })
        });
        let [forward, _, _, _, left, ..] = twist.covariance;
        let sigma_m_s = [forward, left].map(|variance| match variance > 0.0 {
            true => variance.sqrt(),
            false => UNKNOWN_SIGMA_M_S,
        });
        if self.states.len() == CAPACITY {
            self.states.pop_front();
        }
        self.states.push_back(TwistState {
            stamp_ns,
            integral,
            velocity: twist.velocity,
            sigma_m_s,
        });
    }

    /// Forgets what is before an instant and not needed any more.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        let after = self.states.partition_point(|m| m.stamp_ns <= stamp_ns);
        // The last state before it stays: the instant is between it and the next one.
        self.states.drain(..after.saturating_sub(1));
    }

    /// What was measured between two instants; `None` where twists do not cover that time.
    pub fn between(&self, from_ns: i64, to_ns: i64) -> Option<MeasuredWay> {
        let (from, to) = (self.at(from_ns)?, self.at(to_ns)?);
        let begin = self.states.partition_point(|m| m.stamp_ns <= from_ns);
        let mut stamps = (self.states.iter().skip(begin.saturating_sub(1))).map(|m| m.stamp_ns);
        let mut last_ns = stamps.next()?;
        for stamp_ns in stamps {
            if stamp_ns - last_ns > HOLE_NS && last_ns < to_ns {
                return None;
            }
            last_ns = stamp_ns;
        }
        let [forward_m, left_m, turn_rad] = std::array::from_fn(|axis| to[axis] - from[axis]);
        let dt_s = (to_ns - from_ns) as f64 * 1e-9;
        (dt_s > 0.0).then_some(MeasuredWay {
            way_m: [forward_m, left_m],
            turn_rad,
            dt_s,
            sigma_m_s: self.states.back()?.sigma_m_s,
        })
    }

    /// What is integrated at an instant, at the last velocity shortly beyond the twists.
    fn at(&self, stamp_ns: i64) -> Option<[f64; 3]> {
        let after = self.states.partition_point(|m| m.stamp_ns < stamp_ns);
        let before = after.checked_sub(1).and_then(|i| self.states.get(i));
        match (before, self.states.get(after)) {
            (Some(a), Some(b)) => {
                let share = (stamp_ns - a.stamp_ns) as f64 / (b.stamp_ns - a.stamp_ns) as f64;
                Some(std::array::from_fn(|axis| {
                    a.integral[axis] + (b.integral[axis] - a.integral[axis]) * share
                }))
            }
            (Some(edge), None) | (None, Some(edge)) => {
                let beyond_ns = stamp_ns - edge.stamp_ns;
                let beyond_s = beyond_ns as f64 * 1e-9;
                (beyond_ns.abs() <= HELD_NS).then(|| {
                    std::array::from_fn(|axis| edge.integral[axis] + edge.velocity[axis] * beyond_s)
                })
            }
            (None, None) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: i64 = 20_000_000;

    fn twist(stamp_ns: i64, forward_m_s: f64) -> Twist {
        let mut twist = Twist::default();
        twist.header.stamp_ns = stamp_ns;
        twist.velocity = [forward_m_s, 0.0, 0.5];
        twist
    }

    /// Twists of half a second that gain 1 m/s^2.
    fn integrator() -> TwistIntegrator {
        let mut integrator = TwistIntegrator::new();
        (0..=25).for_each(|i| integrator.push(&twist(i * STEP_NS, 0.02 * i as f64)));
        integrator
    }

    #[test]
    fn a_way_is_the_velocitys_integral() {
        let way = integrator().between(100_000_000, 300_000_000).unwrap();
        assert!((way.way_m[0] - 0.04).abs() < 1e-12 && (way.speed_m_s() - 0.2).abs() < 1e-12);
        assert!((way.turn_rad - 0.1).abs() < 1e-12 && way.way_m[1] == 0.0);
        assert_eq!(way.sigma_m_s, [UNKNOWN_SIGMA_M_S; 2]);
        // Shortly beyond the last one it goes on.
        let way = integrator().between(500_000_000, 600_000_000).unwrap();
        assert!((way.way_m[0] - 0.05).abs() < 1e-12);
    }

    #[test]
    fn what_twists_do_not_cover_is_unknown() {
        let mut integrator = integrator();
        assert_eq!(integrator.between(400_000_000, 601_000_000), None);
        integrator.push(&twist(800_000_000, 0.5));
        assert_eq!(integrator.between(400_000_000, 600_000_000), None);
        assert!(integrator.between(300_000_000, 500_000_000).is_some());
        assert_eq!(integrator.between(800_000_000, 800_000_000), None);
        integrator.push(&twist(800_000_000, 0.5));
        assert_eq!(integrator.rejected, 1);
        // The clock was set back by more than a second.
        (0..2).for_each(|i| integrator.push(&twist(10_000_000_000 + i, 0.5)));
        integrator.push(&twist(1, 0.5));
        assert_eq!(integrator.states.len(), 1);
    }
}

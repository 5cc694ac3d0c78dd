//! Whether the gyro's bias leaves what it was: the turn over some seconds, by the bias of before,
//! against the heading that radar and gyro together have.

use crate::sliding_window::WindowScan;
use randt_geometry::elementary::wrap;
use randt_persist::persist;
use std::collections::VecDeque;

/// Turn over that many scans, against the bias of before, where the bias has moved, degrees. Sound
/// drives show at most 1.2, 2.4 and 3.8, where all rooms look alike 4.0, and with gaps or fast
/// spins some over 1.5 in the first; a bias that grows by 1 degree/s in 100 s shows 2.2, 4.8 and
/// 9.3.
const TURNS: [(usize, f64); 3] = [(50, 2.0), (100, 2.7), (150, 4.3)];
const TURN_SCANS_MAX: usize = 150;
/// Scans before a turn whose mean is the bias of before.
const BEFORE_SCANS: usize = 25;
const SCANS: usize = TURN_SCANS_MAX + BEFORE_SCANS;
/// Scans until the bias is known well enough to be compared with.
const WAIT_SCANS: u32 = 50;

/// One scan.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    dt_s: f64,
    /// By how much more the gyro turned than the heading, bias and all, rad.
    excess_rad: f64,
    /// The bias as it was estimated, rad/s.
    bias_rad_s: f64,
}

persist!(Step {
    dt_s,
    excess_rad,
    bias_rad_s
});

/// The last scans in a row.
#[derive(Clone, Debug)]
pub struct BiasDrift {
    steps: VecDeque<Step>,
    /// Heading of the last one, rad.
    yaw_rad: Option<f64>,
    /// Scans that are still waited for.
    waiting: u32,
}

persist!(BiasDrift {
    steps,
    yaw_rad,
    waiting,
} sound is_sound);

impl Default for BiasDrift {
    fn default() -> Self {
        Self {
            steps: VecDeque::with_capacity(SCANS),
            yaw_rad: None,
            waiting: WAIT_SCANS,
        }
    }
}

impl BiasDrift {
    fn is_sound(&self) -> bool {
        self.steps.len() <= SCANS && self.waiting <= WAIT_SCANS
    }

    /// Scans are not compared with those before.
    pub fn restart(&mut self) {
        self.steps.clear();
        self.yaw_rad = None;
        self.waiting = WAIT_SCANS;
    }

    /// Takes a scan that was estimated, and the gyro's turn since the one before, rad. Gives
    /// whether the bias has moved.
    pub fn push(&mut self, scan: &WindowScan, turn_rad: f64) -> bool {
        let yaw_rad = scan.state.odom_from_base.yaw_rad;
        let Some(last_rad) = self.yaw_rad.replace(yaw_rad) else {
            return false;
        };
        self.observe(Step {
            dt_s: scan.dt_s,
            excess_rad: wrap(turn_rad - (yaw_rad - last_rad)),
            bias_rad_s: scan.state.bias_rad_s,
        })
    }

    fn observe(&mut self, step: Step) -> bool {
        if self.waiting > 0 {
            self.waiting -= 1;
            return false;
        }
        if self.steps.len() == SCANS {
            self.steps.pop_front();
        }
        self.steps.push_back(step);
        let mut turns = TURNS.iter();
        turns.any(|(scans, moved_deg)| {
            let off_rad = self.off_rad(*scans).unwrap_or_default();
            off_rad.to_degrees().abs() > *moved_deg
        })
    }

    /// By how much the turn over the last scans differs from the heading's and what the bias of
    /// before makes of that time, rad.
    fn off_rad(&self, scans: usize) -> Option<f64> {
        let skipped = self.steps.len().checked_sub(scans + BEFORE_SCANS)?;
        let before = self.steps.iter().skip(skipped).take(BEFORE_SCANS);
        let bias_rad_s = before.map(|step| step.bias_rad_s).sum::<f64>() / BEFORE_SCANS as f64;
        let turned = self.steps.iter().skip(skipped + BEFORE_SCANS);
        Some(
            turned
                .map(|step| step.excess_rad - bias_rad_s * step.dt_s)
                .sum(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scans of 0.2 s of a gyro whose bias, in degrees/s, the estimate does not follow: the first
    /// time at which it has moved, s.
    fn moved_s(bias_deg_s: impl Fn(f64) -> f64) -> Option<f64> {
        let mut drift = BiasDrift::default();
        let known_rad_s = bias_deg_s(0.0).to_radians();
        (0..600).map(|scan| f64::from(scan) * 0.2).find(|t_s| {
            drift.observe(Step {
                dt_s: 0.2,
                excess_rad: bias_deg_s(*t_s).to_radians() * 0.2,
                bias_rad_s: known_rad_s,
            })
        })
    }

    #[test]
    fn a_bias_that_creeps_is_found_and_a_constant_one_is_not() {
        assert_eq!(moved_s(|_| 0.5), None);
        // A degree/s in 100 s from 40 s on: 2.7 degrees in twenty seconds after 23 s.
        let found_s = moved_s(|t_s| 0.01 * (t_s - 40.0).max(0.0));
        assert!(
            found_s.is_some_and(|t_s| (62.5..64.0).contains(&t_s)),
            "{found_s:?}"
        );
        // What a walk of a sound gyro does in that time.
        assert_eq!(moved_s(|t_s| 0.0005 * t_s), None);
    }
}

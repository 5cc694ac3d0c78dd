//! Means of what the last scans still wanted to turn.

use randt_persist::persist;
use std::collections::VecDeque;

/// Mean of what that many scans in a row still want to turn, degrees: from the first on the bias
/// is another one, from the second on it is no bias. Sound drives show at most 0.56, 0.33, 0.21,
/// 0.15 and 0.11; where all rooms look alike 0.81, 0.68, 0.48, 0.37 and 0.26, so that some drives
/// there show a bias that did not move. One that steps by 1 degree/s shows 1.6, a turned sign 3 and
/// more.
const WANTED: [(usize, f64, f64); 5] = [
    (3, 1.2, 3.0),
    (10, 0.8, 2.0),
    (25, 0.45, 1.5),
    (50, 0.36, 1.3),
    (100, 0.28, 1.0),
];
const SCANS: usize = 100;
/// A window of two seconds shows a wrong gyro where the mean over this many scans is more, degrees.
const BRIEF: usize = 5;
const BRIEF_DEG: f64 = 0.6;

/// The last scans' turns, the newest last, degrees.
#[derive(Clone, Debug)]
pub struct WantedMeans {
    turns_deg: VecDeque<f64>,
}

persist!(WantedMeans { turns_deg } sound is_sound);

impl Default for WantedMeans {
    fn default() -> Self {
        Self {
            turns_deg: VecDeque::with_capacity(SCANS),
        }
    }
}

impl WantedMeans {
    fn is_sound(&self) -> bool {
        self.turns_deg.len() <= SCANS
    }

    /// Scans are not compared with those before.
    pub fn restart(&mut self) {
        self.turns_deg.clear();
    }

    /// Takes what a scan wanted to turn, rad.
    pub fn push(&mut self, turn_rad: f64) {
        if self.turns_deg.len() == SCANS {
            self.turns_deg.pop_front();
        }
        self.turns_deg.push_back(turn_rad.to_degrees());
    }

    /// Whether no bias of the gyro makes them.
    pub fn are_no_bias(&self) -> bool {
        let mut horizons = WANTED.iter();
        horizons.any(|(scans, _, wrong_deg)| self.mean_deg(*scans) > *wrong_deg)
    }

    /// Whether the gyro's bias is not the one that it was.
    pub fn show_another_bias(&self) -> bool {
        let mut horizons = WANTED.iter();
        horizons.any(|(scans, moved_deg, _)| self.mean_deg(*scans) > *moved_deg)
    }

    /// Whether a window shows it too: what only shows in a long mean, it does not.
    pub fn show_in_a_window(&self) -> bool {
        self.mean_deg(BRIEF) > BRIEF_DEG
    }

    /// Length of the mean over the last scans, of which there may be fewer.
    fn mean_deg(&self, scans: usize) -> f64 {
        let sum: f64 = self.turns_deg.iter().rev().take(scans).sum();
        sum.abs() / scans as f64
    }
}

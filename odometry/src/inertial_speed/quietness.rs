//! How quiet the robot is when it stands: what tells a standstill from a slow and even drive.

use randt_persist::persist;

/// A robot that stands is as quiet as when it stood before, but for this factor on the spread of
/// its acceleration: a window of 250 samples shows it to 3 %.
const QUIET_MAX: f64 = 1.5;
/// ... and that grows by no more than this factor from window to window: the last one of a stop
/// has some of the motion.
const QUIET_RISE: f64 = 1.1;

/// What the windows without motion have shown that the radar saw too.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quietness {
    /// Spread of the acceleration in the last one in which the robot stood, m/s^2.
    still_spread_m_s2: Option<f64>,
    /// Whether the robot drives as quietly.
    drives_quietly: bool,
}

persist!(Quietness {
    still_spread_m_s2,
    drives_quietly
});

impl Quietness {
    /// Whether a window without motion, of that spread, is a standstill. `fits`: whether it can be
    /// one by what is known of speed and vertical; `is_fixed`: whether the radar shows the way.
    pub fn admits(&mut self, spread_m_s2: f64, fits: bool, is_fixed: bool) -> bool {
        let known_m_s2 = self.still_spread_m_s2;
        let is_quiet = known_m_s2.is_some_and(|known_m_s2| spread_m_s2 <= QUIET_MAX * known_m_s2);
        match (fits, is_fixed) {
            (true, true) => {
                let raised_m_s2 = known_m_s2.unwrap_or(f64::INFINITY) * QUIET_RISE;
                self.still_spread_m_s2 = Some(spread_m_s2.min(raised_m_s2));
                true
            }
            (false, true) => {
                self.drives_quietly |= is_quiet;
                false
            }
            (true, false) => is_quiet || known_m_s2.is_none(),
            (false, false) => is_quiet && !self.drives_quietly,
        }
    }
}

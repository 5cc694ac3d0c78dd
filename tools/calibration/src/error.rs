//! Why a drive does not show a parameter.

/// A parameter that was not excited, and what would excite it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unobservable {
    /// Too little turning for the time offset.
    #[error(
        "the drive turns too little: {turning} stretches of {stretch_s:.0} s change their yaw rate by {rate_rad_s} rad/s or more, and it takes {needed}; drive curves or turn in place"
    )]
    Turning {
        /// Stretches that turn enough.
        turning: usize,
        /// Stretches that are needed.
        needed: usize,
        /// Length of one.
        stretch_s: f64,
        /// Standard deviation of the yaw rate that makes a stretch count.
        rate_rad_s: f64,
    },
    /// Gyro and radar turn differently, whatever the offset.
    #[error(
        "gyro and radar do not turn alike within {limit_ms:.0} ms: at {offset_ms:.0} ms the gyro explains {share:.0} % of the radar's turning; is it this robot's gyro, and the right way up?"
    )]
    Unlike {
        /// Largest offset that was tried.
        limit_ms: f64,
        /// The best of them.
        offset_ms: f64,
        /// What it explains, percent.
        share: f64,
    },
    /// Too few straights for the yaw.
    #[error(
        "too little straight driving: {chunks} stretches, {path_m:.1} m in all, and it takes {needed} and {needed_m:.0} m; drive straight for some metres, several times"
    )]
    Straight {
        /// Stretches that were found.
        chunks: usize,
        /// Stretches that are needed.
        needed: usize,
        /// Their path, m.
        path_m: f64,
        /// The path that is needed, m.
        needed_m: f64,
    },
    /// Too few turns in place for the lever arm.
    #[error(
        "too little turning in place: {left_deg:.0} degrees to the left and {right_deg:.0} to the right about one point, and it takes {needed_deg:.0} of each; turn in place, both ways"
    )]
    TurnsInPlace {
        /// Turned to the left about the best point, degrees.
        left_deg: f64,
        /// The same to the right, degrees.
        right_deg: f64,
        /// What is needed each way, degrees.
        needed_deg: f64,
    },
    /// The lever arm in the robot's frame needs the yaw.
    #[error(
        "the yaw is unknown: the axis is {distance_m:.3} m from the radar, in a direction that only straights show"
    )]
    Direction {
        /// Distance of the robot's turning axis from the radar, m.
        distance_m: f64,
    },
}

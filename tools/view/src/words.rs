//! How old and how good what is shown is, in words.

use crate::Board;
use randt_foxglove_schemas::status::Mood;
use randt_messages::Trust;

/// From this age on a pose is said to be old, s: three sweeps of an iSDR-C, and what odometry needs.
const OLD_S: f64 = 1.0;
/// From this one on it is not to be believed: a robot has gone on meanwhile.
const DEAD_S: f64 = 2.0;
/// From this round trip on the link is said to be slow, s.
const SLOW_S: f64 = 1.5;

/// A line such as "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s".
pub(crate) fn of(board: &Board, now_ns: i64, round_trip_s: f64) -> (String, Mood) {
    let link = format!("link {round_trip_s:.1} s");
    let (Some(state), Some(age_s)) = (board.state, board.age_s(now_ns)) else {
        return (
            format!("no pose yet: odometry has said nothing, {link}"),
            Mood::Bad,
        );
    };
    if age_s >= DEAD_S {
        return (
            format!("pose {age_s:.0} s old, odometry silent, {link}"),
            Mood::Bad,
        );
    }
    let mood = match state.trust() {
        Trust::Good => Mood::Good,
        Trust::Degraded => Mood::Doubtful,
        Trust::Lost => Mood::Bad,
    };
    let trust = state.trust().as_str();
    let mut words = format!("pose {age_s:.1} s old, trust {trust}, ");
    if let Some(rate_hz) = board.rate_hz() {
        words.push_str(&format!("{rate_hz:.1} Hz, "));
    }
    words.push_str(&link);
    let is_in_map = |frame| frame == state.odom_frame_id;
    if !board.correction.is_some_and(|c| is_in_map(c.odom_frame_id)) {
        words.push_str(", not in the map yet");
    }
    let is_slow = age_s >= OLD_S || round_trip_s >= SLOW_S;
    match mood {
        Mood::Good if is_slow => (words, Mood::Doubtful),
        mood => (words, mood),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Robot;
    use randt_messages::{Correction, OdometryState};

    #[test]
    fn an_old_pose_is_said_to_be_old() {
        const S: i64 = 1_000_000_000;
        let mut board = Board::new(Robot::default());
        let (words, mood) = of(&board, 0, 0.0);
        assert!(words.starts_with("no pose yet") && mood == Mood::Bad);
        let mut state = OdometryState {
            trust: Trust::Good as u32,
            ..OdometryState::default()
        };
        for i in 0..3 {
            state.header.stamp_ns = S + i * S / 5;
            state.header.published_ns = state.header.stamp_ns + S / 10;
            board.take_state(&state);
        }
        let now_ns = state.header.stamp_ns + S / 5;
        let said = of(&board, now_ns, 0.62).0;
        assert_eq!(
            said,
            "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s, not in the map yet"
        );
        board.take_correction(&Correction::default());
        assert_eq!(
            of(&board, now_ns, 0.62),
            (
                "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s".to_owned(),
                Mood::Good
            )
        );
        assert_eq!(of(&board, now_ns, 2.0).1, Mood::Doubtful);
        let late_ns = state.header.stamp_ns + 7 * S;
        let silent = (
            "pose 7 s old, odometry silent, link 0.0 s".to_owned(),
            Mood::Bad,
        );
        assert_eq!(of(&board, late_ns, 0.0), silent);
    }
}

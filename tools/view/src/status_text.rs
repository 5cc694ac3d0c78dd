//! How old and how good what is shown is, as text.

use crate::Board;
use randt_foxglove_schemas::status::StatusLevel;
use randt_messages::{Trust, TrustText};

/// From this age on a pose is shown as old, s: three sweeps of an iSDR-C, and what odometry needs.
const OLD_S: f64 = 1.0;
/// From this age on it is not to be trusted: a robot has moved on meanwhile.
const DEAD_S: f64 = 2.0;
/// From this round trip on the link counts as slow, s.
const SLOW_S: f64 = 1.5;

/// A line such as "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s".
pub(crate) fn status_text(board: &Board, now_ns: i64, round_trip_s: f64) -> (String, StatusLevel) {
    let link = format!("link {round_trip_s:.1} s");
    let (Some(state), Some(age_s)) = (board.state, board.age_s(now_ns)) else {
        let text = format!("no pose yet: odometry has published nothing, {link}");
        return (text, StatusLevel::Bad);
    };
    if age_s >= DEAD_S {
        let text = format!("pose {age_s:.0} s old, odometry silent, {link}");
        return (text, StatusLevel::Bad);
    }
    let trust = state.trust();
    let level = match trust {
        Trust::Good => StatusLevel::Good,
        Trust::Degraded => StatusLevel::Doubtful,
        Trust::Lost => StatusLevel::Bad,
    };
    let trust = TrustText::new(&state);
    let mut text = format!("pose {age_s:.1} s old, trust {trust}, ");
    if let Some(rate_hz) = board.rate_hz() {
        text.push_str(&format!("{rate_hz:.1} Hz, "));
    }
    text.push_str(&link);
    let is_in_map = |frame| frame == state.odom_frame_id;
    if !board.correction.is_some_and(|c| is_in_map(c.odom_frame_id)) {
        text.push_str(", not in the map yet");
    }
    let is_slow = age_s >= OLD_S || round_trip_s >= SLOW_S;
    match level {
        StatusLevel::Good if is_slow => (text, StatusLevel::Doubtful),
        level => (text, level),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;
    use randt_messages::{Correction, Localizability, OdometryState, TrustReason};

    #[test]
    fn an_old_pose_is_shown_as_old() {
        const S: i64 = 1_000_000_000;
        let mut board = Board::new(&Config::default());
        let (text, level) = status_text(&board, 0, 0.0);
        assert!(text.starts_with("no pose yet") && level == StatusLevel::Bad);
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
        let text = status_text(&board, now_ns, 0.62).0;
        assert_eq!(
            text,
            "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s, not in the map yet"
        );
        board.take_correction(&Correction::default());
        assert_eq!(
            status_text(&board, now_ns, 0.62),
            (
                "pose 0.2 s old, trust good, 5.0 Hz, link 0.6 s".to_owned(),
                StatusLevel::Good
            )
        );
        assert_eq!(status_text(&board, now_ns, 2.0).1, StatusLevel::Doubtful);
        state.trust = Trust::Degraded as u32;
        state.trust_reasons = TrustReason::Weak as u32;
        state.localizability = Localizability::Partial as u32;
        state.weak_direction_rad = 0.5;
        board.take_state(&state);
        let (text, level) = status_text(&board, now_ns, 0.62);
        let doubted = "trust degraded: nothing seen along +29 deg (ahead left)";
        assert!(text.contains(doubted), "{text}");
        assert_eq!(level, StatusLevel::Doubtful);
        let late_ns = state.header.stamp_ns + 7 * S;
        let silent = (
            "pose 7 s old, odometry silent, link 0.0 s".to_owned(),
            StatusLevel::Bad,
        );
        assert_eq!(status_text(&board, late_ns, 0.0), silent);
    }
}

//! States that come from several places.

use super::*;

fn state(id: u64, frame: u64) -> OdometryState {
    let mut state = OdometryState {
        id,
        scan_epoch: 5,
        scan_sequence: 100 + id,
        odom_frame_id: frame,
        ..OdometryState::default()
    };
    state.header.stamp_ns = id as i64 * 200_000_000;
    state
}

fn merged(states: &[OdometryState]) -> Results {
    let mut results = Results::merged();
    states.iter().for_each(|it| results.state(it));
    results
}

#[test]
fn a_state_counts_once_and_fills_the_hole_that_it_is_of() {
    let mut results = merged(&[0, 1, 4, 5, 4].map(|id| state(id, 0)));
    assert_eq!((results.states.len(), results.states_missing()), (4, 2));
    // What odometry kept itself, and a frame after that.
    for (id, frame) in [(3, 0), (2, 0), (6, 1), (5, 0)] {
        results.state(&state(id, frame));
    }
    let ids: Vec<u64> = results.states.iter().map(|state| state.id).collect();
    assert_eq!(ids, [0, 1, 2, 3, 4, 5, 6]);
    assert_eq!(results.states_missing(), 0);
}

#[test]
fn numbers_that_begin_anew_miss_nothing_but_their_own_beginning() {
    let mut again = state(2, 1);
    again.header.stamp_ns += 60_000_000_000;
    again.scan_epoch = 6;
    let results = merged(&[state(1, 0), state(2, 0), again]);
    assert_eq!(results.states_missing(), 1 + 2);
}

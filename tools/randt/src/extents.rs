//! How much of a drive something held for: scans, seconds, metres.

use randt_geometry::Pose2;
use randt_messages::{OdometryState, TrustReason};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Scans, with the time and the live path up to each of them from the one before in its frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Extent {
    /// Number of scans.
    pub scans: u64,
    /// Time, s.
    pub seconds: f64,
    /// Path, m.
    pub path_m: f64,
}

/// Extents by names.
pub type Extents = BTreeMap<Cow<'static, str>, Extent>;

/// By what the scans were doubted for. A scan that has two reasons counts for both.
pub fn by_trust_reason(states: &[OdometryState]) -> Extents {
    by_names(states, |state| {
        TrustReason::in_set(state.trust_reasons).map(TrustReason::as_str)
    })
}

/// By which directions the scans saw.
pub fn by_localizability(states: &[OdometryState]) -> Extents {
    by_names(states, |state| [state.localizability().as_str()])
}

fn by_names<N: IntoIterator<Item = &'static str>>(
    states: &[OdometryState],
    names: impl Fn(&OdometryState) -> N,
) -> Extents {
    let mut extents = Extents::new();
    let before = std::iter::once(None).chain(states.iter().map(Some));
    for (before, state) in before.zip(states) {
        let before = before.filter(|before| before.odom_frame_id == state.odom_frame_id);
        let [seconds, path_m] = before.map_or([0.0; 2], |before| {
            let [from, to] = [before, state].map(|state| Pose2::from_array(state.pose));
            let ns = state.header.stamp_ns - before.header.stamp_ns;
            [ns as f64 * 1e-9, from.between(&to).translation().norm()]
        });
        for name in names(state) {
            let extent = extents.entry(name.into()).or_default();
            extent.scans += 1;
            extent.seconds += seconds;
            extent.path_m += path_m;
        }
    }
    extents
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Localizability;

    fn state(second: i64, frame: u64, reasons: u32) -> OdometryState {
        let mut state = OdometryState {
            odom_frame_id: frame,
            pose: [2.0 * second as f64, 0.0, 0.0],
            trust_reasons: reasons,
            localizability: Localizability::Full as u32,
            ..OdometryState::default()
        };
        state.header.stamp_ns = second * 1_000_000_000;
        state
    }

    #[test]
    fn a_scan_counts_for_each_of_its_reasons_and_a_frame_begins_at_nothing() {
        let (weak, held) = (TrustReason::Weak as u32, TrustReason::Held as u32);
        let states = [
            state(0, 0, 0),
            state(1, 0, weak),
            state(2, 0, weak | held),
            state(9, 1, held),
        ];
        let reasons = by_trust_reason(&states);
        let extent = |scans, seconds, path_m| Extent {
            scans,
            seconds,
            path_m,
        };
        assert_eq!(reasons.len(), 2);
        assert_eq!(reasons["weak"], extent(2, 2.0, 4.0));
        assert_eq!(reasons["held"], extent(2, 1.0, 2.0));
        let seen = by_localizability(&states);
        assert_eq!(seen.len(), 1);
        assert_eq!(seen["full"], extent(4, 2.0, 4.0));
    }
}

//! What was published live against what is computed again from the same log.

use crate::output::warn;
use crate::units::count;
use anyhow::Context;
use randt_log::LogReader;
use randt_messages::{OdometryState, OdometryStateTopic};
use randt_readers::log_files;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::path::Path;

/// A scan by its publisher's epoch and its number there.
type Scan = (u64, u64);

/// What both have, and where they differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Scans whose pose was published and computed again.
    pub compared: u64,
    /// Of these, those whose pose is not the same to the last bit.
    pub differ: u64,
    /// Published, and not computed again.
    pub published_only: u64,
    /// Computed again, and never published: odometry was not there yet, or the log lacks the
    /// state.
    pub computed_only: u64,
    /// Scans that odometry had computed before the first one that was published here: what it knew
    /// by them is not in the log.
    pub unseen: u64,
    /// The first of those that differ.
    pub first: Option<Difference>,
}

/// Where both differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Stamp of the scan.
    pub stamp_ns: i64,
    /// Its number.
    pub scan: u64,
    /// What differs first, of: frame, IMU used, pose.
    pub what: Cow<'static, str>,
    /// Computed minus published: x m, y m, yaw rad.
    pub by: [f64; 3],
}

impl Comparison {
    /// Compares by scan. A state that was sent again after a restart counts once.
    pub fn new(published: &[OdometryState], computed: &[OdometryState]) -> Self {
        let scan = |state: &OdometryState| -> Scan { (state.scan_epoch, state.scan_sequence) };
        let mut open: HashMap<Scan, &OdometryState> =
            published.iter().map(|state| (scan(state), state)).collect();
        let mut comparison = Self {
            unseen: published.first().map_or(0, |state| state.id),
            ..Self::default()
        };
        // Frames are numbered from wherever odometry began.
        let mut frame_shift = None;
        for state in computed {
            let Some(live) = open.remove(&scan(state)) else {
                comparison.computed_only += 1;
                continue;
            };
            comparison.compared += 1;
            let shift = live.odom_frame_id.wrapping_sub(state.odom_frame_id);
            let shift = shift == *frame_shift.get_or_insert(shift);
            let Some(what) = difference(live, state, shift) else {
                continue;
            };
            comparison.differ += 1;
            let ([x, y, yaw], [live_x, live_y, live_yaw]) = (state.pose, live.pose);
            comparison.first.get_or_insert(Difference {
                stamp_ns: state.header.stamp_ns,
                scan: state.scan_sequence,
                what: what.into(),
                by: [x - live_x, y - live_y, yaw - live_yaw],
            });
        }
        comparison.published_only = open.len() as u64;
        comparison
    }

    /// Whether all that was published came out the same.
    pub fn same(&self) -> bool {
        self.differ == 0 && self.published_only == 0 && self.compared > 0
    }
}

/// What differs first.
fn difference(
    live: &OdometryState,
    again: &OdometryState,
    same_frame: bool,
) -> Option<&'static str> {
    let bits = |state: &OdometryState| state.pose.map(f64::to_bits);
    let used = |state: &OdometryState| (state.imu_epoch, state.imu_sequence, state.imu_use);
    if !same_frame {
        Some("frame")
    } else if used(live) != used(again) {
        Some("IMU used")
    } else if bits(live) != bits(again) {
        Some("pose")
    } else {
        None
    }
}

/// The states that a log, or a folder of logs, holds, in order.
pub fn published(log: &Path) -> anyhow::Result<Vec<OdometryState>> {
    let mut states = Vec::new();
    let logs = log_files(log)?;
    for why in &logs.unreadable {
        warn(&format!("left out: {why}"));
    }
    for file in logs.files {
        let mut reader = LogReader::open(&file).with_context(|| {
            format!(
                "{}: only a log of a live run has poses to compare with",
                file.display()
            )
        })?;
        while let Some(entry) = reader.next_entry()? {
            if let Some(state) = entry.decode::<OdometryStateTopic>()? {
                states.push(*state.head);
            }
        }
        reader.translated().for_each(|text| warn(&text));
    }
    anyhow::ensure!(
        !states.is_empty(),
        "{}: no pose was recorded in it, so there is nothing to compare with",
        log.display()
    );
    Ok(states)
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let poses = count(self.compared, "published pose", "published poses");
        match &self.first {
            _ if self.compared == 0 => write!(f, "no scan was both published and computed again")?,
            None => write!(f, "{poses} computed again: the same to the last bit")?,
            Some(first) => {
                let (differ, what, [x, y, yaw]) = (self.differ, &first.what, first.by);
                let (scan, stamp_ns) = (first.scan, first.stamp_ns);
                write!(
                    f,
                    "{poses} computed again: {differ} differ, first at scan {scan} (stamp {stamp_ns} ns): {what} ({x:.1e} m, {y:.1e} m, {yaw:.1e} rad)"
                )?
            }
        }
        if self.unseen > 0 && self.differ > 0 {
            write!(
                f,
                "; the log begins {} into the drive, so that odometry's past is missing: compare from the drive's first file",
                count(self.unseen, "scan", "scans")
            )?;
        }
        let (published, computed) = (self.published_only, self.computed_only);
        if published > 0 {
            write!(f, "; {published} published, but not computed again")?;
        }
        if computed > 0 {
            write!(f, "; {computed} computed, but never published")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn states(count: u64) -> Vec<OdometryState> {
        let state = |id| OdometryState {
            id,
            scan_epoch: 5,
            scan_sequence: 100 + id,
            pose: [id as f64 * 0.1, 0.0, 0.0],
            ..OdometryState::default()
        };
        (0..count).map(state).collect()
    }

    #[test]
    fn the_text_names_a_log_that_begins_in_the_middle_of_a_drive() {
        let live = states(20).split_off(5);
        let mut again = live.clone();
        again[0].pose[0] += 0.1;
        let text = Comparison::new(&live, &again).to_string();
        assert!(text.contains("begins 5 scans into the drive"), "{text}");
        let text = Comparison::new(&live, &live).to_string();
        assert!(text.ends_with("the same to the last bit"), "{text}");
    }

    #[test]
    fn poses_are_compared_to_the_last_bit() {
        let live = states(10);
        let same = Comparison::new(&live, &live);
        assert!(
            same.same() && same.to_string().contains("10 published poses"),
            "{same}"
        );
        let mut again = live.clone();
        again[7].pose[1] = f64::MIN_POSITIVE;
        again[8].imu_sequence = 3;
        let found = Comparison::new(&live, &again);
        assert!(!found.same());
        assert_eq!((found.compared, found.differ), (10, 2));
        let first = found.first.unwrap();
        assert_eq!((first.scan, &*first.what), (107, "pose"));
    }

    #[test]
    fn what_only_one_has_is_counted_and_what_was_sent_twice_is_not() {
        let (mut live, all) = (states(10), states(10));
        live.drain(..2);
        live.push(live[3]);
        let found = Comparison::new(&live, &all);
        assert!(found.same());
        assert_eq!((found.compared, found.computed_only), (8, 2));
        let found = Comparison::new(&all, &all[..4]);
        assert_eq!((found.published_only, found.same()), (6, false));
        assert!(!Comparison::new(&[], &all).same());
    }

    #[test]
    fn frames_may_be_numbered_from_anywhere_but_change_together() {
        let mut live = states(6);
        live.iter_mut().for_each(|state| state.odom_frame_id = 7);
        let mut again = states(6);
        assert!(Comparison::new(&live, &again).same());
        again[4].odom_frame_id = 1;
        let first = Comparison::new(&live, &again).first.unwrap();
        assert_eq!((first.scan, &*first.what), (104, "frame"));
    }
}

//! What the stages of a drive leave behind: odometry's checkpoint, the ring of keyframes, the
//! mapper's journal.
//!
//! Responsible for making one pipeline of them that goes on where the processes ended. What is
//! missing is counted, and never an error: half a drive is better than none.

use crate::earlier::{JOURNAL, is_quarantined_journal};
use crate::pipeline::Pipeline;
use crate::plain_file;
use crate::report::Counters;
use randt_config::Config;
use randt_mapper::Mapper;
use randt_messages::{Keyframe, Message, OdometryState};
use randt_odometry::Odometry;
use randt_odometry::runtime::CheckpointStore;
use randt_stage::KeyframeRing;
use std::fs;
use std::path::Path;

/// A drive as its processes left it.
pub struct RecoveredDrive {
    /// Odometry with its window still open, where it left one, and the map with all keyframes that
    /// there are.
    pub pipeline: Pipeline,
    /// Whether that is odometry as it was; else one that knows nothing.
    pub has_odometry: bool,
    /// The last states that odometry published.
    pub states: Vec<OdometryState>,
    /// What is missing.
    pub counters: Counters,
}

impl RecoveredDrive {
    /// Reads them. `folder`: where the journal lies; `state`: where odometry keeps what outlives
    /// it, if that is known.
    pub fn read(config: &Config, use_imu: bool, folder: &Path, state: Option<&Path>) -> Self {
        let mut counters = Counters::default();
        let mut mapper = read_journal(config, &folder.join(JOURNAL), &mut counters);
        count_quarantined(folder, &mut counters);
        let left = state.map(|state| CheckpointStore::read(state, config, use_imu));
        let (mut odometry, mut ring, mut states) = (None, None, Vec::new());
        let mut why = "odometry's state was not kept".to_owned();
        if let Some(left) = left {
            match left.odometry {
                Ok(found) => odometry = Some(found),
                Err(error) => why = error.to_string(),
            }
            ring = left.ring.and_then(Result::ok);
            states = left.states;
        }
        if !is_of_map(&mapper, ring.as_ref(), odometry.as_ref()) {
            why = "odometry's state is of another drive than the map".to_owned();
            (odometry, ring, states) = (None, None, Vec::new());
        }
        if let Some(ring) = &ring {
            let end = odometry.as_ref().map(|it| it.pose_record().next_keyframe);
            let lost = push_ring(&mut mapper, ring, end);
            let first = "keyframes that neither journal nor ring has";
            counters.add_lost("keyframes_lost", lost, first);
        }
        let has_odometry = odometry.is_some();
        if !has_odometry {
            counters.add_lost("window_lost", 1, why);
        }
        let odometry = odometry.unwrap_or_else(|| Odometry::new(config, use_imu));
        Self {
            pipeline: Pipeline::resume(config, odometry, mapper, has_odometry),
            has_odometry,
            states,
            counters,
        }
    }
}

/// The map of a journal; an empty one where there is none, or none that can be read.
fn read_journal(config: &Config, path: &Path, counters: &mut Counters) -> Mapper {
    let restored = match plain_file::read(path) {
        Ok(bytes) => Mapper::restore(config, &bytes).map_err(|error| error.to_string()),
        Err(_) if !path.exists() => Err("it is not there".to_owned()),
        Err(error) => Err(error.to_string()),
    };
    let (mapper, damage) = match restored {
        Ok((mapper, restored)) => {
            let damage = restored.damage;
            (
                mapper,
                damage.map(|it| format!("offset {}: {}", it.offset, it.what)),
            )
        }
        Err(why) => (Mapper::new(config), Some(why)),
    };
    if let Some(damage) = damage {
        counters.add_lost("journal_damaged", 1, format!("{JOURNAL}: {damage}"));
    }
    mapper
}

/// A journal that the mapper quarantined during the drive has a part of it that the map has not.
fn count_quarantined(folder: &Path, counters: &mut Counters) {
    let found = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = found.filter_map(|entry| entry.file_name().into_string().ok());
    let mut quarantined: Vec<String> = names.filter(|name| is_quarantined_journal(name)).collect();
    quarantined.sort();
    if let Some(first) = quarantined.first() {
        let first = format!("{first} holds keyframes that are not in the map");
        counters.add_lost("journals_quarantined", quarantined.len() as u64, first);
    }
}

/// Whether odometry numbers the drive that the map is of. Where the ring has no keyframe that the
/// map has too, nothing speaks against it.
fn is_of_map(mapper: &Mapper, ring: Option<&KeyframeRing>, odometry: Option<&Odometry>) -> bool {
    let Some(last) = mapper.keyframes().last() else {
        return true;
    };
    let is_counted = odometry.is_none_or(|it| it.pose_record().next_keyframe > last.keyframe_id);
    let shown = ring.and_then(|ring| ring.get(last.keyframe_id));
    is_counted && shown.is_none_or(|shown| shown.head.header.stamp_ns == last.stamp_ns)
}

/// Gives the map the keyframes that it had no time for, up to `end` where that is known; gives how
/// many are nowhere.
fn push_ring(mapper: &mut Mapper, ring: &KeyframeRing, end: Option<u64>) -> u64 {
    let last = mapper.keyframes().last();
    let first = last.map_or(0, |keyframe| keyframe.keyframe_id + 1);
    let end = end.or(ring.newest().map(|newest| newest + 1));
    let end = end.unwrap_or(first);
    let mut lost = 0;
    for id in first..end {
        match ring.get(id) {
            Some(keyframe) => _ = mapper.push(Message::<Keyframe>::as_ref(&keyframe)),
            None => lost += 1,
        }
    }
    lost
}

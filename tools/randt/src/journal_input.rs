//! A mapper's journal as an input: its keyframes are a drive without the scans between them, of
//! which the map can be computed again, under another configuration too.

use crate::earlier::JOURNAL;
use crate::job;
use crate::plain_file;
use crate::progress;
use crate::report::{Count, Counters};
use crate::results::Results;
use anyhow::Context;
use randt_config::Config;
use randt_mapper::Mapper;
use randt_mapper::journal::{self, Bytes, Contents, Header};
use randt_messages::{ImuUse, KeyframeHead, OdometryState};
use randt_readers::log_files;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Variance of what a keyframe does not say: how well its pose was known against its submap.
const UNKNOWN_VARIANCE: f64 = 1e6;

/// The journal that a path stands for: itself, or the one in a folder that has no logs, which hold
/// every scan.
pub fn journal_of(path: &Path) -> Option<PathBuf> {
    if !path.is_dir() {
        return is_journal(path).then(|| path.to_owned());
    }
    let journal = path.join(JOURNAL);
    let has_logs = log_files(path).is_ok_and(|logs| !logs.files.is_empty());
    (!has_logs && is_journal(&journal)).then_some(journal)
}

fn is_journal(path: &Path) -> bool {
    let mut begin = [0; journal::MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && begin == journal::MAGIC
}

/// What a journal holds.
pub struct JournalInput {
    /// For messages to the user.
    path: PathBuf,
    contents: Contents,
    /// The keyframes' heads, in order.
    pub heads: Vec<KeyframeHead>,
    /// What the map was computed by.
    header: Header,
    /// What was found wrong with it.
    pub counters: Counters,
}

impl JournalInput {
    /// Reads a journal up to where it stops making sense.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let shown = || path.display().to_string();
        let bytes: Bytes = Arc::new(plain_file::read(path).with_context(shown)?);
        let (header, _) = journal::records((*bytes).as_ref()).with_context(shown)?;
        let contents = Contents::read(&bytes).with_context(shown)?;
        let mut counters = Counters::default();
        if let Some(damage) = &contents.damage {
            let first = format!("{}: offset {}: {}", shown(), damage.offset, damage.what);
            counters.add_lost("journal_damaged", 1, first);
        }
        let mut head = Box::<KeyframeHead>::default();
        let mut heads = Vec::new();
        for packed in &contents.keyframes {
            if journal::read_head(packed, &mut head) {
                heads.push(*head);
            }
        }
        let unread = (contents.keyframes.len() - heads.len()) as u64;
        counters.add_lost(
            "keyframes_lost",
            unread,
            format!("{}: not readable", shown()),
        );
        Ok(Self {
            path: path.to_owned(),
            contents,
            heads,
            header,
            counters,
        })
    }

    /// Whether its map was computed by another configuration.
    pub fn is_of_another_configuration(&self, config: &Config) -> bool {
        self.header != Header::new(config)
    }

    /// The map of its keyframes, computed anew, their poses, and what there is to say.
    pub fn compute(self, config: &Config) -> (Mapper, Results, Counters) {
        let other = self.is_of_another_configuration(config);
        let mut counters = self.counters;
        let note = |count: usize, first: &str| Count {
            count: count as u64,
            first: first.to_owned(),
            loss: false,
        };
        counters.add(
            "poses_of_keyframes_only",
            note(self.heads.len(), "a journal has no scans between keyframes"),
        );
        counters.add(
            "journal_of_another_configuration",
            note(
                usize::from(other),
                "the map was computed by other settings than these (--profile, --sensor, --set)",
            ),
        );
        let mut mapper = Mapper::new(config);
        let bar = progress::bar(Some(self.contents.keyframes.len() as u64), "keyframes");
        let mut refused = 0;
        for packed in &self.contents.keyframes {
            refused += u64::from(!mapper.push_packed(packed));
            bar.inc(1);
            if job::interrupted() {
                counters.add_lost("interrupted", 1, "the input was not read to its end");
                break;
            }
        }
        bar.finish_and_clear();
        let first = format!("{}: a keyframe is not the next one", self.path.display());
        counters.add_lost("keyframes_refused", refused, first);
        let states = (0..).zip(&self.heads).map(state).collect();
        let mut results = Results::default();
        results.states = states;
        (mapper, results, counters)
    }
}

/// What a keyframe says of its scan.
fn state((id, head): (u64, &KeyframeHead)) -> OdometryState {
    let unknown = UNKNOWN_VARIANCE;
    OdometryState {
        header: head.header,
        id,
        odom_frame_id: head.odom_frame_id,
        pose: head.pose,
        velocity: head.twist,
        covariance: [unknown, 0.0, 0.0, 0.0, unknown, 0.0, 0.0, 0.0, unknown],
        attitude: [1.0, 0.0, 0.0, 0.0],
        weak_direction_rad: head.weak_direction_rad,
        trust: head.trust,
        trust_reasons: head.trust_reasons,
        localizability: head.localizability,
        scan_sequence: head.scan_sequence,
        imu_sequence: u64::MAX,
        imu_use: ImuUse::None as u32,
        submap_id: head.submap_id,
        ..OdometryState::default()
    }
}

//! What a mission's logs hold: every scan's state, what was not recorded, and the scans that
//! odometry has not computed.
//!
//! Odometry goes on from where it ended, with what the logs have after that. Where its state is
//! gone, because memory was lost with the power, it computes the scans since the last boot anew:
//! the map takes what comes of that where odometry makes its last keyframe once more, bit for bit.

use crate::output::warn;
use crate::recovered_drive::RecoveredDrive;
use crate::results::Results;
use randt_config::Config;
use randt_filter::check_sweep;
use randt_log::LogReader;
use randt_messages::{
    Header, ImuSampleTopic, LogDropTopic, OdometryState, OdometryStateTopic, RadarScan, TwistTopic,
};
use randt_odometry::{MessageId, Sink};
use randt_readers::Event;
use std::path::{Path, PathBuf};

/// Where a log has the offset from its stamps to dates; the anchor is taken anew at each boot.
const CLOCK: &str = "randt/clock";
const ANCHOR: &str = "anchor_ns";

/// A mission's logs, read.
pub struct Logged {
    /// The state of every scan, in order.
    pub results: Results,
    /// What the stages left behind, with what the logs have beyond that.
    pub recovered: RecoveredDrive,
    /// Messages that the recorder could not record.
    pub not_recorded: u64,
    /// Files that could not be read to their end, and why not the first of them.
    pub unreadable: u64,
    pub first_unreadable: String,
    pub imu_samples: u64,
}

impl Logged {
    /// Reads files in the order of time.
    pub fn read(files: &[PathBuf], config: &Config, recovered: RecoveredDrive) -> Self {
        let mut logged = Self {
            results: Results::merged(),
            recovered,
            not_recorded: 0,
            unreadable: 0,
            first_unreadable: String::new(),
            imu_samples: 0,
        };
        let boot = files.iter().rev().find_map(|file| boot_of(file));
        if !logged.recovered.has_odometry {
            let of_boot = |file: &&PathBuf| boot_of(file) == boot;
            logged.number_on(files.iter().filter(of_boot));
        }
        let mut computed = Results::default();
        for file in files {
            let goes_on = boot_of(file) == boot;
            // Half a report is better than none.
            if let Err(error) = logged.add(file, config, goes_on, &mut computed) {
                logged.unreadable += 1;
                if logged.first_unreadable.is_empty() {
                    logged.first_unreadable = format!("{error:#}");
                }
            }
        }
        logged.take(computed.states, config);
        logged
    }

    /// Odometry that begins anew numbers on after the map as it did at the boot.
    fn number_on<'a>(&mut self, mut files: impl Iterator<Item = &'a PathBuf>) {
        let Some(first) = files.find_map(|file| first_state(file)) else {
            return;
        };
        if let Some(before) = first.odom_frame_id.checked_sub(1) {
            self.recovered.pipeline.continue_after(before);
        }
    }

    fn add(
        &mut self,
        file: &Path,
        config: &Config,
        goes_on: bool,
        computed: &mut Results,
    ) -> anyhow::Result<()> {
        let mut reader = LogReader::open(file)?;
        let pipeline = &mut self.recovered.pipeline;
        while let Some(entry) = reader.next_entry()? {
            if let Some(state) = entry.decode::<OdometryStateTopic>()? {
                // Sent again by odometry that came back, and recorded again by the recorder that
                // did: it counts once.
                self.results.state(state.head.as_ref());
            } else if let Some(missing) = entry.decode::<LogDropTopic>()? {
                self.not_recorded += missing.head.count;
            } else if let Some(sample) = entry.decode::<ImuSampleTopic>()? {
                self.imu_samples += 1;
                if goes_on && is_after(&sample.head.header, pipeline.odometry().last_imu()) {
                    pipeline.push(&Event::Imu(*sample.head), computed);
                }
            } else if let Some(twist) = entry.decode::<TwistTopic>()? {
                if goes_on && is_after(&twist.head.header, pipeline.odometry().last_twist()) {
                    pipeline.push(&Event::Twist(*twist.head), computed);
                }
            } else if let Some(scan) = entry.decode::<RadarScan>()? {
                let is_new = is_after(&scan.head.header, pipeline.odometry().last_scan());
                if goes_on && is_new && check_sweep(&scan.head.sweep, config).is_ok() {
                    pipeline.push(&Event::Scan(scan), computed);
                }
            }
        }
        reader.translated().for_each(|text| warn(&text));
        Ok(())
    }

    /// Takes what was computed now, where it is of the mission's drive.
    fn take(&mut self, computed: Vec<OdometryState>, config: &Config) {
        let recovered = &mut self.recovered;
        if !recovered.has_odometry {
            if computed.is_empty() || !recovered.pipeline.is_one_drive() {
                if !computed.is_empty() {
                    let first = "the logs end before the map's last keyframe, or give another one";
                    recovered.counters.add_lost("window_lost", 1, first);
                }
                recovered.pipeline.forget_odometry(config);
                return;
            }
            recovered.counters.remove("window_lost");
        }
        recovered.states.extend(computed);
        for state in &recovered.states {
            self.results.state(state);
        }
    }
}

/// Which boot a log was recorded in.
fn boot_of(file: &Path) -> Option<String> {
    let reader = LogReader::open(file).ok()?;
    reader.metadata(CLOCK)?.get(ANCHOR).cloned()
}

/// The first state that a log holds.
fn first_state(file: &Path) -> Option<OdometryState> {
    let mut reader = LogReader::open(file).ok()?;
    while let Ok(Some(entry)) = reader.next_entry() {
        if let Ok(Some(state)) = entry.decode::<OdometryStateTopic>() {
            return Some(*state.head);
        }
    }
    None
}

/// Whether a message comes after the last one that was taken. Within a boot epochs rise.
fn is_after(header: &Header, last: Option<MessageId>) -> bool {
    let id = (header.epoch, header.sequence);
    last.is_none_or(|last| id > (last.epoch, last.sequence))
}

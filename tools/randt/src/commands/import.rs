//! `randt import`: a recording of another format becomes our log.

use crate::exit::Outcome;
use crate::input::InputOptions;
use crate::job;
use crate::output::{finish, head_only, log_options, may_write, print};
use crate::progress;
use anyhow::ensure;
use randt_log::{LogFile, ROBOT_METADATA, Robot};
use randt_messages::{ImuSampleTopic, TruthPoseTopic, TwistTopic};
use randt_readers::{Counter, Event, InputInfo};
use std::path::PathBuf;

/// Arguments of `randt import`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A folder of polar images (Oxford, Boreas, MulRan, RADIATE), a ROS 1 bag, a ROS 2 bag (MCAP,
    /// db3, or its folder), one of our logs, a folder of them, or a mission
    input: PathBuf,
    /// The log to write; it gets this name when it is whole
    log: PathBuf,
    /// Overwrite the log if it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    options: InputOptions,
}

/// Reads the input to its end and writes what it holds.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let Arguments {
        input,
        log,
        force,
        options,
    } = arguments;
    may_write(&log, force)?;
    job::catch_interrupts();
    let mut source = randt_readers::open(&input, &options.options())?;
    let info = source.info().clone();
    let bar = progress::bar(info.scans, "sweeps");

    let mut file = LogFile::create(&log, log_options())?;
    file.write_metadata(ROBOT_METADATA, robot(&info).to_metadata())?;
    let (mut scans, mut samples, mut truths) = (0_u64, 0_u64, 0_u64);
    while let Some(event) = source.next_event()? {
        ensure!(!job::interrupted(), "interrupted; nothing was written");
        match event {
            Event::Scan(scan) => {
                file.write(scan.as_ref())?;
                scans += 1;
                bar.inc(1);
            }
            Event::Imu(sample) => {
                file.write(head_only::<ImuSampleTopic>(&sample))?;
                samples += 1;
            }
            Event::Twist(twist) => file.write(head_only::<TwistTopic>(&twist))?,
            Event::Truth(pose) => {
                file.write(head_only::<TruthPoseTopic>(&pose))?;
                truths += 1;
            }
        }
    }
    let size = finish(file, &log)?;
    bar.finish_and_clear();

    let counters = source.counters();
    let name = log.display();
    let mut text = format!(
        "{name}: {scans} sweeps, {samples} IMU samples, {truths} true poses from a {}; {:.1} MB\n",
        info.format,
        size as f64 * 1e-6
    );
    text.extend(counters.iter().map(line));
    print(&text)?;
    let lost = counters.iter().any(|counter| counter.loss);
    Ok(Outcome::finished(lost))
}

fn robot(info: &InputInfo) -> Robot {
    Robot {
        sensor: info.sensor,
        radar: info.extrinsics.radar.map(|pose| pose.to_array()),
        imu: info.extrinsics.imu.map(|rotation| rotation.to_array()),
    }
}

/// A counter as a line of text.
fn line(counter: &Counter) -> String {
    let kind = if counter.loss { "lost" } else { "note" };
    let (count, name, first) = (counter.count, counter.name, &counter.first);
    format!("  {kind} {count} {name}: {first}\n")
}

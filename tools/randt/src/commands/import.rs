//! `randt import`: a recording of another format becomes our log.

use crate::exit::Outcome;
use crate::input::InputOptions;
use crate::job;
use crate::output::{may_write, print};
use crate::progress;
use anyhow::{Context, bail};
use randt_log::{LogFile, Options, ROBOT_METADATA, Robot};
use randt_messages::{ImuSampleTopic, Message, Topic, TruthPoseTopic};
use randt_readers::{Counter, Event, InputInfo};
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `randt import`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An Oxford Radar RobotCar folder, a ROS 1 bag, a ROS 2 bag (MCAP, db3, or its folder), or
    /// one of our logs
    input: PathBuf,
    /// The log to write; it gets this name when it is whole
    log: PathBuf,
    /// Overwrite the log if it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    options: InputOptions,
}

/// What was written.
#[derive(Debug, Default)]
struct Written {
    scans: u64,
    samples: u64,
    truths: u64,
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

    let written_by = format!("randt {}", randt_version::VERSION);
    let mut file = LogFile::create(
        &log,
        Options {
            written_by,
            ..Options::default()
        },
    )?;
    file.write_metadata(ROBOT_METADATA, robot(&info).to_metadata())?;
    let mut written = Written::default();
    while let Some(event) = source.next_event()? {
        if job::interrupted() {
            bail!("interrupted; nothing was written");
        }
        match event {
            Event::Scan(scan) => {
                file.write(scan.as_ref())?;
                written.scans += 1;
                bar.inc(1);
            }
            Event::Imu(sample) => {
                file.write(single::<ImuSampleTopic>(sample).as_ref())?;
                written.samples += 1;
            }
            Event::Truth(pose) => {
                file.write(single::<TruthPoseTopic>(pose).as_ref())?;
                written.truths += 1;
            }
        }
    }
    let size = file
        .finish()
        .with_context(|| format!("{}: cannot be finished", log.display()))?;
    bar.finish_and_clear();

    let counters = source.counters();
    let name = log.display();
    let Written {
        scans,
        samples,
        truths,
    } = written;
    let mut text = format!(
        "{name}: {scans} sweeps, {samples} IMU samples, {truths} true poses from a {}; {:.1} MB\n",
        info.format,
        size as f64 * 1e-6
    );
    for counter in &counters {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{}", line(counter));
    }
    print(&text)?;
    Ok(if counters.iter().any(|counter| counter.loss) {
        Outcome::DataLost
    } else {
        Outcome::Good
    })
}

/// A message that is only a head.
fn single<T: Topic>(head: T::Head) -> Message<T> {
    let mut message = Message::default();
    *message.head = head;
    message
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
    format!(
        "  {kind} {} {}: {}",
        counter.count, counter.name, counter.first
    )
}

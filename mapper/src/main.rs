//! `randt-mapper`: odometry/keyframe to mapper/correction, mapper/graph and mapper/grid, as a
//! process.

mod runtime;

use clap::Parser;
use randt_mapper::SECTIONS;
use randt_messages::Keyframe;
use randt_stage::{StageArguments, WakeReason, ended, parse};
use runtime::{KeyframeIngest, MapPublisher};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// The mapper stage: loops, the pose graph, the occupancy grid.
///
/// Every keyframe goes into a journal before the map that it makes is published. A stage that is
/// started again has the same map, to the last bit, and asks odometry for what it has missed.
#[derive(Debug, Parser)]
#[command(name = "randt-mapper", max_term_width = 100)]
struct Arguments {
    /// The journal, on a disk; if not given, in the run folder, where it survives the stage but
    /// not the machine
    #[arg(long, value_name = "FILE")]
    journal: Option<PathBuf>,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("mapper", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = arguments.stage.selection.load(None)?.config;
    let mut stage = arguments.stage.open("mapper")?;
    stage.expect_sensor(&config.sensor);
    stage.follow_configuration(&arguments.stage.selection, &config, &SECTIONS, None);
    let mut publisher = MapPublisher::open(&mut stage)?;
    let mut keyframes = stage.subscriber::<Keyframe>()?;
    let in_run_folder = || stage.domain().state().join("map.journal");
    let journal = arguments.journal.clone().unwrap_or_else(in_run_folder);
    let mut ingest = KeyframeIngest::open(&journal, &config, &mut stage)?;
    stage.set_status_note(&ingest.progress());
    stage.running()?;
    let mut at_once = true;
    loop {
        publisher.publish(&mut ingest, at_once)?;
        let pause = match ingest.is_behind() {
            true => Some(Duration::ZERO),
            false => Some(publisher.pause().min(ingest.writer.pause())),
        };
        if stage.wait(&[&keyframes], pause)? == WakeReason::Stop {
            break;
        }
        at_once = false;
        while let Some(keyframe) = keyframes.receive()? {
            at_once |= ingest.take(keyframe.message());
        }
        if ingest.catch_up() {
            stage.log_info(&format!(
                "has all of its {} keyframes",
                ingest.sequence.next
            ));
        }
        at_once |= ingest.sync();
        if ingest.sequence.is_other_drive {
            ingest = ingest.begin_anew(&journal, &config, &mut stage)?;
            publisher.begin_anew();
            at_once = true;
        }
        stage.set_status(&ingest.writer.trouble, ingest.sequence.lost);
        stage.set_status_note(&ingest.progress());
        stage.set_remark(&ingest.delay());
        if ingest.writer.is_unsure {
            return Err(ingest.writer.trouble.into());
        }
    }
    // What odometry sent before it ended.
    while let Some(keyframe) = keyframes.receive()? {
        ingest.take(keyframe.message());
    }
    ingest.finish();
    Ok(stage.close()?)
}

//! `randt-mapper`: odometry/keyframe to mapper/correction, mapper/graph and mapper/grid, as a process.

mod process;

use clap::Parser;
use process::{Intake, Outlet};
use randt_mapper::SECTIONS;
use randt_messages::Keyframe;
use randt_stage::{StageArguments, WakeReason, ended, parse};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// The mapper stage: loops, the pose graph, the occupancy grid.
///
/// Every keyframe goes into a journal before the map that it makes is told. When the stage is started again it is what
/// it was, to the last bit, and asks odometry for what it has missed.
#[derive(Debug, Parser)]
#[command(name = "randt-mapper", max_term_width = 100)]
struct Arguments {
    /// The journal, on a disk; if not given, in the run folder, where it survives the stage but not the machine
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
    let mut outlet = Outlet::open(&mut stage)?;
    let mut keyframes = stage.subscriber::<Keyframe>()?;
    let journal = match &arguments.journal {
        Some(path) => path.clone(),
        None => stage.domain().state().join("map.journal"),
    };
    let mut intake = Intake::open(&journal, &config, &mut stage)?;
    stage.set_status_note(&intake.progress());
    stage.running()?;
    let mut at_once = true;
    loop {
        outlet.tell(&mut intake, at_once)?;
        let pause = match intake.is_behind() {
            true => Some(Duration::ZERO),
            false => Some(outlet.pause()),
        };
        if stage.wait(&[&keyframes], pause)? == WakeReason::Stop {
            break;
        }
        at_once = false;
        while let Some(keyframe) = keyframes.receive()? {
            at_once |= intake.take(keyframe.message());
        }
        if intake.catch_up() {
            stage.log_info(&format!("has all of its {} keyframes", intake.next()));
        }
        at_once |= intake.sync();
        if intake.is_other_drive {
            intake = intake.begin_anew(&journal, &config, &mut stage)?;
            outlet.begin_anew();
            at_once = true;
        }
        stage.set_status(&intake.trouble, intake.lost);
        stage.set_status_note(&intake.progress());
        stage.set_remark(&intake.delay());
        if intake.is_unsure {
            return Err(intake.trouble.into());
        }
    }
    // What odometry sent before it ended.
    while let Some(keyframe) = keyframes.receive()? {
        intake.take(keyframe.message());
    }
    intake.finish();
    Ok(stage.close()?)
}

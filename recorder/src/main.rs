//! `randt-recorder`: every topic to MCAP, as a process.

use clap::Parser;
use randt_config::Config;
use randt_recorder::Viewer;
use randt_recorder::process::{Inputs, preamble};
use randt_recorder::{BUDGET, Disk, Queue, Recorder, Settings, Worker};
use randt_stage::{StageArguments, Woken, ended, go_behind, parse};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// Samples alone wake nobody; they are fetched so often.
const PAUSE: Duration = Duration::from_millis(200);

/// The recorder stage: every message of every topic, and what viewers need, into log files.
///
/// A file is called NAME.mcap.active until it is finished. A disk that is slow, full, broken or gone is told of in the stage's state and
/// never holds the pipeline up; recording goes on when it can, and the log says what is missing.
#[derive(Debug, Parser)]
#[command(name = "randt-recorder", version, max_term_width = 100)]
struct Arguments {
    /// Folder for the logs, instead of record.folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("recorder", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let loaded = arguments.stage.selection.load(None)?;
    let record = &loaded.config.record;
    let folder = arguments
        .out
        .clone()
        .unwrap_or(record.folder.clone().into());
    go_behind();
    let mut stage = arguments.stage.open("recorder")?;
    // What it writes says by what the others compute.
    let all: Vec<_> = Config::SECTIONS.iter().map(|it| it.name).collect();
    stage.follow(&arguments.stage.selection, &loaded.config, &all, None);
    let clock = stage.clock();
    let mut inputs = Inputs::open(&mut stage)?;
    let queue = Arc::new(Queue::new(BUDGET));
    let recorder = Recorder::new(
        Disk::new(&folder),
        Settings::of(record),
        preamble(&loaded, stage.realm(), clock),
        Viewer::new(loaded.config.robot.clone()),
    );
    let worker = Worker::start(Arc::clone(&queue), recorder, move || clock.now_ns());
    stage.running()?;
    let mut file = String::new();
    loop {
        inputs.drain(&queue, clock)?;
        let condition = worker.condition();
        stage.report(&condition.trouble, queue.lost());
        if condition.file != file {
            file = condition.file;
            if !file.is_empty() {
                stage.say(&format!("{}", folder.join(&file).display()));
                stage.note(&format!("writing {file}"));
            }
        }
        if worker.has_died() {
            return Err("the thread that writes has died".into());
        }
        if stage.wait(&inputs.wakes(), Some(PAUSE))? == Woken::Stop {
            break;
        }
    }
    // What the others sent before they ended.
    inputs.drain(&queue, clock)?;
    worker.finish();
    Ok(stage.close()?)
}

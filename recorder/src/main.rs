//! `randt-recorder`: every topic to MCAP, as a process.

use clap::Parser;
use randt_config::Config;
use randt_recorder::runtime::{Inputs, preamble};
use randt_recorder::{
    BUDGET, Disk, PositionStore, Positions, Queue, Recorder, Settings, Viewer, Worker,
};
use randt_stage::{StageArguments, WakeReason, ended, lower_priority, parse};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// Samples alone do not wake the stage; they are fetched with this period.
const PAUSE: Duration = Duration::from_millis(200);
/// Exit code: finished, but data were lost.
const DATA_LOST: u8 = 3;

/// The recorder stage: every message of every topic, and what viewers need, into log files.
///
/// A file is called NAME.mcap.active until it is finished. A disk that is slow, full, broken or
/// gone is reported in the stage's status and never holds the pipeline up; recording goes on when
/// it can, and the log lists what is missing.
#[derive(Debug, Parser)]
#[command(name = "randt-recorder", max_term_width = 100)]
struct Arguments {
    /// Folder for the logs, instead of record.folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    match run(&parse()) {
        Ok(lost) if lost > 0 => ExitCode::from(DATA_LOST),
        done => ended("recorder", done.map(|_| ())),
    }
}

/// Records until the end is asked for; gives how many messages no log has.
fn run(arguments: &Arguments) -> Result<u64, Box<dyn Error>> {
    let loaded = arguments.stage.selection.load(None)?;
    let record = &loaded.config.record;
    let configured = || record.folder.clone().into();
    let folder = arguments.out.clone().unwrap_or_else(configured);
    lower_priority();
    let mut stage = arguments.stage.open("recorder")?;
    // What it writes has the configuration of the others.
    let all: Vec<_> = Config::SECTIONS.iter().map(|it| it.name).collect();
    stage.follow_configuration(&arguments.stage.selection, &loaded.config, &all, None);
    let clock = stage.clock();
    let mut store = PositionStore::open(&mut stage, &folder)?;
    let recorded = store.positions().clone();
    let mut inputs = Inputs::open(&mut stage, recorded.clone())?;
    let queue = Arc::new(Queue::new(BUDGET));
    let recorder = Recorder::new(
        Disk::new(&folder),
        Settings::from_config(record),
        preamble(&loaded, stage.domain(), clock),
        Viewer::new(&loaded.config),
        recorded,
    );
    let now_ns = move || clock.now_ns();
    let keep = move |positions: &Positions| store.keep(positions);
    let worker = Worker::start(Arc::clone(&queue), recorder, now_ns, keep);
    stage.running()?;
    let mut file = String::new();
    loop {
        inputs.drain(&queue, clock)?;
        let status = worker.status();
        let lost = queue.lost() + status.lost;
        let message = match status.outage.as_str() {
            "" if lost > 0 => format!("{lost} messages are in no log, log/drop lists them"),
            outage => outage.to_owned(),
        };
        // What its ports have missed the ports count themselves.
        stage.set_status(&message, lost.saturating_sub(inputs.missed_by_ports()));
        if status.file != file {
            file = status.file;
            if !file.is_empty() {
                stage.log_info(&format!("{}", folder.join(&file).display()));
                stage.set_status_note(&format!("writing {file}"));
            }
        }
        if worker.has_died() {
            return Err("the thread that writes has died".into());
        }
        if stage.wait(&inputs.waitables(), Some(PAUSE))? == WakeReason::Stop {
            break;
        }
    }
    // What the others sent before they ended.
    inputs.drain(&queue, clock)?;
    let left = worker.finish();
    let lost = queue.lost() + left;
    if left > 0 {
        let message = format!("{left} messages did not come onto the disk before the end");
        stage.set_status(&message, lost.saturating_sub(inputs.missed_by_ports()));
    }
    stage.close()?;
    Ok(lost)
}

//! Ending the stages that write into a mission, no matter who has started them.

use super::{owner, target};
use crate::mission::Mission;
use anyhow::{Context, bail, ensure};
use randt_stage::{Domain, Entry, Registry, STAGES};
use rustix::process::{Pid, Signal, kill_process};
use std::time::{Duration, Instant};

/// Ended before all stages; `up` ends all that it has started.
const FIRST: [&str; 2] = ["up", "play"];
/// A stage ends within this time ...
const END_MAX: Duration = Duration::from_secs(5);
/// ... but one that brings a log to a busy disk, or a whole pipeline, within this.
const LONG_END_MAX: Duration = Duration::from_secs(40);
/// A signal that comes while iceoryx2 looks at another one is forgotten: a stage is asked again.
const ASK_EVERY: Duration = Duration::from_millis(500);
const POLL_PERIOD: Duration = Duration::from_millis(10);

/// Ends them; gives whether systemd has to start them again. An error names what still writes into
/// the mission.
pub fn stop(mission: &Mission, domain: &Domain) -> anyhow::Result<bool> {
    let is_under_systemd = target::stop()?;
    if !is_under_systemd && owner::owns(mission, domain) {
        stop_by_signals(domain)?;
    }
    ensure!(
        !mission.is_written(),
        "{}: a mapper still writes its map, and not one of the pipeline in {}: stop that one, or say where it is by \
         --prefix and --run; the mission goes on",
        mission.name(),
        domain.folder().display()
    );
    Ok(is_under_systemd)
}

fn stop_by_signals(domain: &Domain) -> anyhow::Result<()> {
    for name in FIRST.into_iter().chain(STAGES) {
        if let Some(stage) = living(domain).into_iter().find(|stage| stage.name == name) {
            end(domain, &stage)?;
        }
    }
    let left: Vec<String> = living(domain).iter().map(shown).collect();
    ensure!(
        left.is_empty(),
        "{} was started again by somebody, or is none that this version knows: stop it first; the mission goes on",
        left.join(", ")
    );
    Ok(())
}

fn living(domain: &Domain) -> Vec<Entry> {
    let all = Registry::all(domain).into_iter();
    let living = all.filter(|(_, lives)| *lives);
    living.map(|(entry, _)| entry).collect()
}

fn shown(stage: &Entry) -> String {
    format!("randt-{} (process {})", stage.name, stage.pid)
}

/// Asks a stage to end, and waits for it.
fn end(domain: &Domain, stage: &Entry) -> anyhow::Result<()> {
    let shown = shown(stage);
    let pid = i32::try_from(stage.pid).ok().and_then(Pid::from_raw);
    let pid = pid.with_context(|| format!("{shown}: no process has that number"))?;
    let is_there = || living(domain).iter().any(|it| it.pid == stage.pid);
    let end_max = match stage.name.as_str() {
        "recorder" | "up" => LONG_END_MAX,
        _ => END_MAX,
    };
    let begin = Instant::now();
    let mut asked: Option<Instant> = None;
    while is_there() {
        if asked.is_none_or(|asked| asked.elapsed() > ASK_EVERY) {
            // A stopped one gets no signal until it goes on. That comes first, because iceoryx2
            // remembers only the last signal.
            let _ = kill_process(pid, Signal::CONT);
            if let Err(error) = kill_process(pid, Signal::TERM)
                && is_there()
            {
                bail!(
                    "{shown}: cannot be ended: {error}: do it as the user that runs it; the mission goes on"
                );
            }
            asked = Some(Instant::now());
        }
        ensure!(
            begin.elapsed() < end_max,
            "{shown}: does not end (kill -9 {pid:?} does it); the mission goes on"
        );
        std::thread::sleep(POLL_PERIOD);
    }
    Ok(())
}

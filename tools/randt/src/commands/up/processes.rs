//! The running stages: started in the order of the data's way, watched, ended along it.

use super::Arguments;
use super::child::Child;
use super::journal::HeldJournal;
use super::launch::{self, PLAY};
use super::program::Program;
use super::watch::{STAGES, Watch};
use crate::exit::Refused;
use crate::output::{warn, write_private};
use crate::report::Counters;
use crate::{job, progress};
use anyhow::{bail, ensure};
use indicatif::ProgressBar;
use randt_config::Loaded;
use randt_readers::Source;
use randt_stage::{Domain, Error, Stage, WakeReason, stop_requested};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How often children and the end are looked for where nothing else happens.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// After the end of the log nothing more is to be expected when nothing has come for this time.
const QUIET: Duration = Duration::from_secs(2);
/// A stage that does not run after this time will not: a start takes a few hundredths of a second.
const START_MAX: Duration = Duration::from_secs(10);
/// Stages that all fail for this long will not come back. What they lack may: memory that others
/// fill for a moment.
const ALL_FAIL_MAX: Duration = Duration::from_secs(30);
/// Between two attempts to see the pipeline again.
const REOPEN_EVERY: Duration = Duration::from_secs(1);

/// Why a drive is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The log was computed.
    Computed,
    /// Somebody asked for it, or ended the log.
    Asked,
    /// Every stage has failed for [`ALL_FAIL_MAX`].
    AllFail,
}

/// All stages of a pipeline, and what is seen of them.
pub struct Processes {
    domain: Domain,
    /// The configuration for the stages, in the run folder.
    profile: (PathBuf, String),
    /// `None` while the pipeline cannot be seen.
    stage: Option<Stage>,
    reopened: Instant,
    /// How often the shared memory was removed or cut, and how it was noticed first.
    memory_gone: (u64, String),
    /// How often the pipeline could not be seen for other reasons, and why first.
    unseen: (u64, String),
    pub watch: Watch,
    /// In the order of the data's way, which is the order in which they are ended.
    children: Vec<Child>,
    bar: ProgressBar,
    pub begin: Instant,
}

impl Processes {
    /// Starts all stages; comes back when those that compute run. Where one of them does not come
    /// up nothing is begun.
    pub fn start(
        arguments: &Arguments,
        domain: &Domain,
        loaded: &Loaded,
        source: Option<&dyn Source>,
    ) -> anyhow::Result<(Self, HeldJournal)> {
        let mut stage = Stage::open("up", domain)?;
        stage.expect_sensor(&loaded.config.sensor);
        let watch = Watch::open(&mut stage)?;
        stage.running()?;
        let profile = domain.folder().join("up.toml");
        launch::write_profile(&profile, loaded)?;
        let bar = progress::bar(source.and_then(|source| source.info().scans), "scans");
        let mut processes = Self {
            domain: domain.clone(),
            profile: (profile, loaded.to_toml()),
            stage: Some(stage),
            reopened: Instant::now(),
            memory_gone: (0, String::new()),
            unseen: (0, String::new()),
            watch,
            children: Vec::new(),
            bar,
            begin: Instant::now(),
        };
        let journal = std::path::absolute(arguments.out.join(crate::earlier::JOURNAL))?;
        let profile = processes.profile.0.clone();
        for program in launch::stages(arguments, domain, &profile, &journal)? {
            processes.add(program);
        }
        processes.wait_until_running()?;
        let journal = HeldJournal::open(&journal)?;
        for program in launch::sources(arguments, domain, &profile)? {
            processes.add(program);
        }
        Ok((processes, journal))
    }

    /// Starts a program whose data go to those that were added before.
    fn add(&mut self, program: Program) {
        let child = Child::start(program, self.bar.clone());
        self.children.insert(0, child);
    }

    /// Waits until every stage reports that it runs. Recorder and view may fail: nobody waits for
    /// them.
    fn wait_until_running(&mut self) -> anyhow::Result<()> {
        let give_up = Instant::now() + START_MAX;
        loop {
            let mut waiting = Vec::new();
            for child in &self.children {
                let is_needed = STAGES.contains(&child.name());
                match child.failing() {
                    Some(why) if is_needed => {
                        let why = format!("randt-{}: {why}", child.name());
                        match child.is_misconfigured() {
                            true => return Err(Refused(why).into()),
                            false => bail!(why),
                        }
                    }
                    Some(_) => {}
                    None if self.watch.runs(child.name()) => {}
                    None => waiting.push((child.name(), is_needed)),
                }
            }
            if waiting.is_empty() {
                return Ok(());
            }
            if Instant::now() > give_up {
                waiting.retain(|(_, is_needed)| *is_needed);
                let names: Vec<&str> = waiting.iter().map(|(name, _)| *name).collect();
                ensure!(
                    names.is_empty(),
                    "{} did not start within {START_MAX:?}",
                    names.join(", ")
                );
                return Ok(());
            }
            if self.wait() == WakeReason::Stop {
                bail!("interrupted before the pipeline ran; nothing was computed");
            }
        }
    }

    /// Watches until the drive is over.
    pub fn watch(&mut self) -> End {
        let mut some_worked = Instant::now();
        loop {
            if self.wait() == WakeReason::Stop {
                return End::Asked;
            }
            let of_stages = self.children.iter().filter(|child| child.name() != PLAY);
            let failing = of_stages.filter(|child| child.failing().is_some());
            let failing: BTreeSet<String> = failing.map(|child| child.name().to_owned()).collect();
            if !STAGES.iter().all(|name| failing.contains(*name)) {
                some_worked = Instant::now();
            } else if some_worked.elapsed() > ALL_FAIL_MAX {
                return End::AllFail;
            }
            self.watch.set_failing(failing);
            if self.play_has_ended() {
                return End::Asked;
            }
            self.bar.set_position(self.watch.scans());
            self.bar.set_message(self.watch.line());
            let quiet = self.watch.quiet_for() > QUIET;
            if self.watch.is_played() && (self.watch.is_computed() || quiet) {
                return End::Computed;
            }
        }
    }

    /// Sleeps until something comes, and takes it. A pipeline that cannot be seen, because
    /// something has happened to its memory, is entered again: the stages go on meanwhile.
    fn wait(&mut self) -> WakeReason {
        // A terminal that was closed; Ctrl-C before the first stage was there.
        if job::interrupted() {
            return WakeReason::Stop;
        }
        let Some(stage) = &mut self.stage else {
            std::thread::sleep(POLL_PERIOD);
            if stop_requested() {
                return WakeReason::Stop;
            }
            if self.reopened.elapsed() > REOPEN_EVERY {
                self.reopen();
            }
            return WakeReason::Timeout;
        };
        let reason = stage.wait(&self.watch.wakes(), Some(POLL_PERIOD));
        let received = self.watch.receive();
        match (reason.map_err(anyhow::Error::from), received) {
            (Ok(reason), Ok(())) => reason,
            (Err(error), _) | (_, Err(error)) => {
                self.lose_pipeline(&error);
                WakeReason::Timeout
            }
        }
    }

    fn lose_pipeline(&mut self, error: &anyhow::Error) {
        let is_memory_gone = matches!(error.downcast_ref(), Some(Error::MemoryGone { .. }));
        let (count, first) = match is_memory_gone {
            true => &mut self.memory_gone,
            false => &mut self.unseen,
        };
        *count += 1;
        if *count == 1 {
            *first = format!("{error:#}");
            let text = format!("the pipeline cannot be seen: {first}; it goes on");
            self.bar.suspend(|| warn(&text));
        }
        self.stage = None;
        if is_memory_gone {
            // The stages come back at once, and need what is in the run folder.
            self.reopen();
        }
    }

    fn reopen(&mut self) {
        self.reopened = Instant::now();
        let opened = Stage::open("up", &self.domain).map_err(anyhow::Error::from);
        let opened = opened.and_then(|mut stage| {
            self.watch.reopen(&mut stage)?;
            stage.running()?;
            // The run folder may be another one now.
            let (profile, text) = &self.profile;
            write_private(profile, text.as_bytes())?;
            Ok(stage)
        });
        // Why not was printed when it began.
        self.stage = opened.ok();
    }

    /// Whether somebody ended the log before its end: what was computed until then is kept.
    fn play_has_ended(&self) -> bool {
        let mut children = self.children.iter();
        children.any(|child| child.name() == PLAY && child.failing().is_some())
    }

    /// Ends the children along the data's way, so that each gets what the one before sent last.
    pub fn stop(&mut self) {
        for child in &mut self.children {
            child.stop();
            if self.stage.is_some()
                && let Err(error) = self.watch.receive()
            {
                self.unseen.0 += 1;
                self.unseen.1 = format!("{error:#}");
                self.stage = None;
            }
        }
        self.bar.finish_and_clear();
        if let Some(Err(error)) = self.stage.take().map(Stage::close) {
            // It has logged all that it had to.
            warn(&format!("randt up: {error}"));
        }
    }

    /// What was lost on the way, and what came back.
    pub fn counters(&self) -> Counters {
        let mut counters = self.watch.counters();
        let stages = self.children.iter().filter(|child| child.name() != PLAY);
        let failures = stages.map(Child::failures).filter(|(n, _)| *n > 0);
        let failures: Vec<_> = failures.collect();
        if let Some((_, first)) = failures.first() {
            let count = failures.iter().map(|(count, _)| count).sum();
            counters.add_lost("stage_failures", count, first);
        }
        let killed = self.children.iter().filter(|child| child.was_killed());
        let killed: Vec<&str> = killed.map(Child::name).collect();
        if !killed.is_empty() {
            let first = format!("{} did not end when asked to", killed.join(", "));
            counters.add_lost("stages_killed", killed.len() as u64, first);
        }
        let (count, first) = &self.memory_gone;
        counters.add_lost("memory_gone", *count, first);
        let (count, first) = &self.unseen;
        counters.add_lost("pipeline_unseen", *count, first);
        counters
    }

    /// The last words of a stage that fails, where one does.
    pub fn why(&self) -> Option<String> {
        let failing = |child: &Child| Some(format!("randt-{}: {}", child.name(), child.failing()?));
        self.children.iter().find_map(failing)
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        // Where starting failed half way; a second stop does nothing.
        self.stop();
    }
}

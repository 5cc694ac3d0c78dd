//! A stage as a child process: started, started again when it dies, ended.

use super::program::Program;
use crate::exit::BAD_CONFIGURATION;
use crate::output::warn;
use indicatif::ProgressBar;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A stage that ends by itself this often in a row, each time this soon, lacks something.
const FAILURES_MAX: u32 = 5;
const SOON: Duration = Duration::from_secs(3);
/// Between two such ends, so that what it waits for can come about; after more of them twice as
/// long each time ...
const BACK_OFF: Duration = Duration::from_millis(100);
/// ... up to this: a stage whose memory or disk is there again is back within it.
const BACK_OFF_MAX: Duration = Duration::from_secs(5);
/// Exit codes of a wrong option and a wrong configuration, which trying again does not fix.
const REFUSALS: [i32; 2] = [2, BAD_CONFIGURATION];
/// A child that does not end on SIGTERM within this time is killed ...
const END_MAX: Duration = Duration::from_secs(5);
/// ... but one that has to bring a log to a busy disk has more, as under systemd.
const RECORDED_MAX: Duration = Duration::from_secs(30);
/// Signals that a program brings upon itself: SIGILL, SIGABRT, SIGBUS, SIGFPE, SIGSEGV.
const FAULTS: [i32; 5] = [4, 6, 7, 8, 11];
/// A signal that comes while iceoryx2 looks at another one is forgotten: a child is asked again.
const ASK_EVERY: Duration = Duration::from_millis(500);
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// A program that is kept running by a thread of its own: a dead stage is back before anybody has
/// noticed.
pub struct Child {
    name: String,
    shared: Arc<Shared>,
    keeper: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    /// 0 while there is none.
    pid: AtomicU32,
    stopping: AtomicBool,
    trouble: Mutex<Trouble>,
}

/// What is wrong with a program.
#[derive(Clone, Debug, Default)]
struct Trouble {
    /// Starts that failed where several did in a row, and ends after which it was not started
    /// again.
    failures: u64,
    /// The last words of the first of them.
    why: String,
    /// Since when it runs, if it has come back from several failures.
    back: Option<Instant>,
    /// Whether it is not started again.
    is_over: bool,
    /// Whether it has refused its configuration.
    is_misconfigured: bool,
    /// Whether it had to be killed at its end.
    was_killed: bool,
}

impl Child {
    /// Starts it; its standard error goes over the bar.
    pub fn start(program: Program, bar: ProgressBar) -> Self {
        let shared = Arc::new(Shared::default());
        let name = program.name.clone();
        let keeper = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || keep(&program, &shared, &bar))
        };
        Self {
            name,
            shared,
            keeper: Some(keeper),
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its last words, where it fails again and again, or will not be started again.
    pub fn failing(&self) -> Option<String> {
        let trouble = self.shared.trouble();
        let is_back = trouble.back.is_some_and(|back| back.elapsed() > SOON);
        (trouble.failures > 0 && (trouble.is_over || !is_back)).then_some(trouble.why)
    }

    /// Whether it is not started again because of its configuration.
    pub fn is_misconfigured(&self) -> bool {
        self.shared.trouble().is_misconfigured
    }

    /// How often it failed by itself, where that was again and again, with the first case; what it
    /// had to do then is lost.
    pub fn failures(&self) -> (u64, String) {
        let Trouble { failures, why, .. } = self.shared.trouble();
        (failures, format!("randt-{}: {why}", self.name))
    }

    /// Whether it did not end when it was asked to, and was killed over what it had still to do.
    pub fn was_killed(&self) -> bool {
        self.shared.trouble().was_killed
    }

    /// Ends it and waits for that.
    pub fn stop(&mut self) {
        let Some(keeper) = self.keeper.take() else {
            return;
        };
        self.shared.stopping.store(true, Ordering::SeqCst);
        let begin = Instant::now();
        let end_max = match self.name.as_str() {
            "recorder" => RECORDED_MAX,
            _ => END_MAX,
        };
        let mut asked: Option<Instant> = None;
        while !keeper.is_finished() {
            let pid = self.shared.pid.load(Ordering::SeqCst) as i32;
            let is_due = asked.is_none_or(|asked| asked.elapsed() > ASK_EVERY);
            if let (true, Some(pid)) = (is_due, Pid::from_raw(pid)) {
                // It may have ended just now.
                if begin.elapsed() > end_max {
                    let _ = kill_process(pid, Signal::KILL);
                    self.shared.change(|trouble| trouble.was_killed = true);
                } else {
                    // A stopped one gets no signal until it goes on. That comes first, because
                    // iceoryx2 remembers only the last signal.
                    let _ = kill_process(pid, Signal::CONT);
                    let _ = kill_process(pid, Signal::TERM);
                }
                asked = Some(Instant::now());
            }
            std::thread::sleep(POLL_PERIOD);
        }
        // A keeper does not panic; if it did, its child is gone all the same.
        let _ = keeper.join();
    }
}

impl Shared {
    fn trouble(&self) -> Trouble {
        // A keeper that panicked has printed why.
        let trouble = self.trouble.lock();
        trouble.map_or_else(|_| Trouble::default(), |it| it.clone())
    }

    fn change(&self, change: impl FnOnce(&mut Trouble)) {
        if let Ok(mut trouble) = self.trouble.lock() {
            change(&mut trouble);
        }
    }

    /// Sleeps, unless the end is asked for.
    fn pause(&self, pause: Duration) {
        let end = Instant::now() + pause;
        while !self.stopping.load(Ordering::SeqCst) && Instant::now() < end {
            std::thread::sleep(POLL_PERIOD.min(pause));
        }
    }
}

/// Starts a program again and again until it is to stop. One that fails in a row is tried less and
/// less often, and never given up: what it lacks may come back, and the others go on meanwhile.
fn keep(program: &Program, shared: &Shared, bar: &ProgressBar) {
    let mut failures = 0;
    let mut has_run = false;
    while !shared.stopping.load(Ordering::SeqCst) {
        let begin = Instant::now();
        let mut last_words = String::new();
        let ended = once(program, shared, bar, &mut last_words);
        if shared.stopping.load(Ordering::SeqCst) {
            return;
        }
        let code = ended.as_ref().ok().and_then(ExitStatus::code);
        let (by_itself, is_refused) = match &ended {
            // Other signals are somebody else's doing.
            Ok(status) => (
                status.signal().is_none_or(|it| FAULTS.contains(&it)),
                code.is_some_and(|code| REFUSALS.contains(&code)),
            ),
            Err(_) => (true, false),
        };
        has_run |= begin.elapsed() >= SOON;
        failures = match by_itself && begin.elapsed() < SOON {
            true => failures + 1,
            false => 0,
        };
        let why = match ended {
            Ok(_) if !last_words.is_empty() => last_words,
            Ok(status) => format!("ended with {status}"),
            Err(error) => format!(
                "{}: {error}; the stages stand beside randt itself (cargo build makes them all)",
                program.path.display()
            ),
        };
        // One that has run by these options will run by them again, when what it was refused for
        // is there again.
        let is_over = program.once || (is_refused && !has_run);
        if is_over || failures >= FAILURES_MAX {
            let is_first = failures <= FAILURES_MAX;
            if is_first && !program.once {
                let then = match is_over {
                    true => "it is not started again",
                    false => "it is tried again, less and less often",
                };
                bar.suspend(|| warn(&format!("randt-{}: fails: {why}; {then}", program.name)));
            }
            shared.change(|trouble| {
                // Those before were not counted yet.
                trouble.failures += match is_first {
                    true => u64::from(failures.max(1)),
                    false => 1,
                };
                if trouble.why.is_empty() {
                    trouble.why = why;
                }
                (trouble.back, trouble.is_over) = (None, is_over);
                trouble.is_misconfigured = is_over && code == Some(BAD_CONFIGURATION);
            });
            if is_over {
                return;
            }
        }
        if by_itself {
            shared.pause(back_off(failures));
        }
        shared.change(|trouble| _ = trouble.back.get_or_insert_with(Instant::now));
    }
}

/// How long to wait after this many failures in a row.
fn back_off(failures: u32) -> Duration {
    let doublings = failures.saturating_sub(FAILURES_MAX - 1).min(16);
    BACK_OFF.saturating_mul(1 << doublings).min(BACK_OFF_MAX)
}

/// One life of a child.
fn once(
    program: &Program,
    shared: &Shared,
    bar: &ProgressBar,
    last_words: &mut String,
) -> std::io::Result<ExitStatus> {
    let mut child = program.start()?;
    shared.pid.store(child.id(), Ordering::SeqCst);
    if let Some(errors) = child.stderr.take() {
        for line in BufReader::new(errors).lines().map_while(Result::ok) {
            bar.suspend(|| warn(&line));
            *last_words = line;
        }
    }
    let status = child.wait();
    shared.pid.store(0, Ordering::SeqCst);
    status
}

#[cfg(test)]
mod tests;

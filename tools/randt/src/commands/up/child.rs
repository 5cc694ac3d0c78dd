//! A stage as a child process: started, started again when it dies, ended.

use anyhow::{Context, ensure};
use indicatif::ProgressBar;
use randt_stage::Realm;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A stage that ends by itself so often in a row, each time this soon, will not get better.
const FAILURES_MAX: u32 = 5;
const SOON: Duration = Duration::from_secs(3);
/// Between two such ends, so that what it waits for can come about.
const BACK_OFF: Duration = Duration::from_millis(100);
/// A child that does not end on SIGTERM within this time is killed ...
const END_MAX: Duration = Duration::from_secs(5);
/// ... but one that has to bring a log to a busy disk has more, as under systemd.
const RECORDED_MAX: Duration = Duration::from_secs(30);
/// Signals that a program brings upon itself: SIGILL, SIGABRT, SIGBUS, SIGFPE, SIGSEGV.
const FAULTS: [i32; 5] = [4, 6, 7, 8, 11];
const LOOK: Duration = Duration::from_millis(5);

/// What to start.
pub struct Program {
    name: String,
    path: PathBuf,
    arguments: Vec<std::ffi::OsString>,
    /// Whether it is not started again: a log that begins anew would be another drive.
    once: bool,
}

impl Program {
    /// A stage's own program, which stands beside this one.
    pub fn stage(name: &str, realm: &Realm) -> anyhow::Result<Self> {
        let this = std::env::current_exe().context("where this program is")?;
        let path = this.with_file_name(format!("randt-{name}"));
        ensure!(
            path.is_file(),
            "{}: not there; the stages stand beside randt itself (cargo build makes them all)",
            path.display()
        );
        Ok(Self::new(name, path, realm))
    }

    /// A command of this program.
    pub fn command(name: &str, realm: &Realm) -> anyhow::Result<Self> {
        let this = std::env::current_exe().context("where this program is")?;
        let mut program = Self::new(name, this, realm);
        program.arguments.insert(0, name.into());
        program.once = true;
        Ok(program)
    }

    fn new(name: &str, path: PathBuf, realm: &Realm) -> Self {
        let mut program = Self {
            name: name.to_owned(),
            path,
            arguments: Vec::new(),
            once: false,
        };
        program.option("--prefix", realm.prefix());
        program.option("--run", realm.run());
        program.option("--parent", std::process::id().to_string());
        program
    }

    /// Adds an option with its value.
    pub fn option(&mut self, name: &str, value: impl AsRef<OsStr>) {
        self.flag(name);
        self.flag(value);
    }

    /// Adds one argument.
    pub fn flag(&mut self, argument: impl AsRef<OsStr>) {
        self.arguments.push(argument.as_ref().to_owned());
    }

    fn start(&self) -> std::io::Result<std::process::Child> {
        Command::new(&self.path)
            .args(&self.arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Ctrl-C is for the supervisor, which ends its children in order.
            .process_group(0)
            .spawn()
    }
}

/// A program that is kept running by a thread of its own: a dead stage is back before anybody has noticed.
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
    given_up: Mutex<Option<String>>,
}

impl Child {
    /// Starts it; what it says on standard error goes over the bar.
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

    /// Why it will not be started again, where that is so.
    pub fn given_up(&self) -> Option<String> {
        // A keeper that panicked has said so.
        self.shared.given_up.lock().ok()?.clone()
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
        let mut signal = Some(rustix::process::Signal::TERM);
        while !keeper.is_finished() {
            let pid = self.shared.pid.load(Ordering::SeqCst) as i32;
            if let (Some(send), Some(pid)) = (signal, rustix::process::Pid::from_raw(pid)) {
                // It may have ended just now.
                let _ = rustix::process::kill_process(pid, send);
                // One that is stopped hears nothing until it goes on.
                let _ = rustix::process::kill_process(pid, rustix::process::Signal::CONT);
                signal = None;
            }
            if begin.elapsed() > end_max {
                signal = Some(rustix::process::Signal::KILL);
            }
            std::thread::sleep(LOOK);
        }
        // A keeper does not panic; if it did, its child is gone all the same.
        let _ = keeper.join();
    }
}

/// Starts a program again and again until it is to stop or is past hope.
fn keep(program: &Program, shared: &Shared, bar: &ProgressBar) {
    let mut failures = 0;
    while !shared.stopping.load(Ordering::SeqCst) {
        let begin = Instant::now();
        let mut last_words = String::new();
        let ended = once(program, shared, bar, &mut last_words);
        if shared.stopping.load(Ordering::SeqCst) {
            return;
        }
        let (by_itself, configuration) = match &ended {
            // Other signals are somebody else's doing.
            Ok(status) => (
                status
                    .signal()
                    .is_none_or(|signal| FAULTS.contains(&signal)),
                status.code() == Some(78),
            ),
            Err(_) => (true, false),
        };
        failures = if by_itself && begin.elapsed() < SOON {
            failures + 1
        } else {
            0
        };
        if program.once || configuration || failures >= FAILURES_MAX {
            let why = match ended {
                Ok(_) if !last_words.is_empty() => last_words,
                Ok(status) => format!("randt-{}: ended with {status}", program.name),
                Err(error) => format!("{}: {error}", program.path.display()),
            };
            if let Ok(mut given_up) = shared.given_up.lock() {
                *given_up = Some(why);
            }
            return;
        }
        if by_itself {
            std::thread::sleep(BACK_OFF);
        }
    }
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
            bar.suspend(|| eprintln!("{line}"));
            *last_words = line;
        }
    }
    let status = child.wait();
    shared.pid.store(0, Ordering::SeqCst);
    status
}

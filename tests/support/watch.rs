//! What the pipeline on a booted machine sends, as it comes: this test's own program runs there as
//! the stages' user and prints a line a message.

use super::boot::Machine;
use randt_messages::{
    ImuUse, MapperCorrection, OdometryStateTopic, StageHealthTopic, StageState, health::text_of,
};
use randt_stage::{Domain, Observer};
use rustix::time::{ClockId, clock_gettime};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Set where this program is the one that prints.
pub const WATCHES: &str = "RANDT_TEST_WATCHES";
/// What is printed.
const MARK: &str = "heard";

/// A message that came.
#[derive(Clone, Debug)]
pub struct Heard {
    /// Of the machine's monotonic clock, microseconds.
    pub at_us: u64,
    /// `state`, `correction`, or a stage's name for its health.
    pub what: String,
    /// The sender's.
    pub epoch: u64,
    /// Of a state: whether the IMU covers it. Of health: whether anything went through the stage's
    /// ports.
    pub flows: bool,
    /// Of a state.
    pub state: Option<State>,
}

/// Which pose of which scan a state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    pub id: u64,
    pub odom_frame_id: u64,
    pub scan_epoch: u64,
    pub scan_sequence: u64,
}

/// The messages so far.
pub struct Watch {
    child: Child,
    heard: Arc<Mutex<Vec<Heard>>>,
}

/// Now, of the monotonic clock, microseconds: systemd's, and the same in every namespace.
pub fn now_us() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    (now.tv_sec * 1_000_000 + now.tv_nsec / 1000).unsigned_abs()
}

/// Prints what comes until nobody listens any more.
pub fn print() {
    let domain = Domain::new("randt", Some(Path::new("/run/randt"))).unwrap();
    let observer = Observer::enter(&domain).unwrap().expect("a stage runs");
    let mut states = observer.subscriber::<OdometryStateTopic>().unwrap();
    let mut corrections = observer.subscriber::<MapperCorrection>().unwrap();
    let mut health = observer.subscriber::<StageHealthTopic>().unwrap();
    let mut out = std::io::stdout();
    let mut lines = format!("{MARK} ready 0 0 true\n");
    loop {
        let mut line = |what: &str, epoch: u64, flows: bool| {
            lines += &format!("{MARK} {what} {} {epoch} {flows}\n", now_us());
        };
        let read = observer.read(&mut states, |state| {
            let head = state.head;
            let what = format!(
                "state:{}:{}:{}:{}",
                head.id, head.odom_frame_id, head.scan_epoch, head.scan_sequence
            );
            let is_covered = head.imu_use == ImuUse::Covered as u32;
            line(&what, head.header.epoch, is_covered);
        });
        read.unwrap();
        let read = observer.read(&mut corrections, |correction| {
            line("correction", correction.head.header.epoch, true)
        });
        read.unwrap();
        let read = observer.read(&mut health, |health| {
            let head = health.head;
            let flows = head.ports().iter().any(|port| port.messages > 0);
            if head.state != StageState::Stopping as u32 {
                line(text_of(&head.name), head.header.epoch, flows);
            }
        });
        read.unwrap();
        if out
            .write_all(lines.as_bytes())
            .and_then(|()| out.flush())
            .is_err()
        {
            return;
        }
        lines.clear();
        std::thread::sleep(Duration::from_millis(2));
    }
}

impl Watch {
    /// Begins on a machine. `program`: this test there.
    pub fn begin(machine: &Machine, program: &str) -> Self {
        let variable = format!("{WATCHES}=1");
        let mut command = machine.command(&[
            "setpriv",
            "--reuid",
            "randt",
            "--regid",
            "randt",
            "--clear-groups",
            "env",
            &variable,
            program,
            "--exact",
            "systemd::watches",
            "--nocapture",
        ]);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let heard = Arc::new(Mutex::new(Vec::new()));
        let (lines, to) = (
            BufReader::new(child.stdout.take().unwrap()),
            Arc::clone(&heard),
        );
        std::thread::spawn(move || {
            for line in lines.lines().map_while(Result::ok) {
                if let Some(heard) = parse(&line) {
                    to.lock().unwrap().push(heard);
                }
            }
        });
        let watch = Self { child, heard };
        watch.first("its first word", 0, |heard| heard.what == "ready");
        watch
    }

    /// Of whom the newest message of a kind is.
    pub fn epoch(&self, what: &str) -> Option<u64> {
        let heard = self.heard.lock().unwrap();
        let mut last = heard.iter().rev();
        last.find(|heard| heard.what == what)
            .map(|heard| heard.epoch)
    }

    /// The states so far, each once.
    pub fn states(&self) -> Vec<State> {
        let heard = self.heard.lock().unwrap();
        let mut states: Vec<State> = heard.iter().filter_map(|heard| heard.state).collect();
        states.sort_by_key(|state| state.id);
        states.dedup();
        states
    }

    /// The first message after an instant that is so.
    pub fn first(&self, what: &str, after_us: u64, is_so: impl Fn(&Heard) -> bool) -> Heard {
        let begin = Instant::now();
        loop {
            let found = {
                let heard = self.heard.lock().unwrap();
                let mut later = heard.iter().filter(|heard| heard.at_us >= after_us);
                later.find(|heard| is_so(heard)).cloned()
            };
            if let Some(found) = found {
                return found;
            }
            assert!(
                begin.elapsed() < Duration::from_secs(60),
                "{what}: never came"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        // It may have ended with its machine.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn parse(line: &str) -> Option<Heard> {
    // The harness may have begun the line.
    let (_, line) = line.split_once(MARK)?;
    let mut words = line.split_whitespace();
    let what = words.next()?;
    let (what, numbers) = what.split_once(':').unwrap_or((what, ""));
    Some(Heard {
        what: what.to_owned(),
        state: state(numbers),
        at_us: words.next()?.parse().ok()?,
        epoch: words.next()?.parse().ok()?,
        flows: words.next()?.parse().ok()?,
    })
}

fn state(numbers: &str) -> Option<State> {
    let mut numbers = numbers.split(':').map_while(|number| number.parse().ok());
    Some(State {
        id: numbers.next()?,
        odom_frame_id: numbers.next()?,
        scan_epoch: numbers.next()?,
        scan_sequence: numbers.next()?,
    })
}

//! `randt up` never ends without its results: whatever is taken from it, trajectory, map and
//! report of what there is are written, and the exit code shows what was lost.

use crate::support::journal::keyframes;
use crate::support::pipeline::{Pipeline, log, signal, until};
use crate::support::programs::Programs;
use crate::support::{Ended, OUTPUTS, ended_within, names, remove_folder, report, run};
use randt_stage::Registry;
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Other tests load the machine: a sample that comes late is waited for, so that both computations
/// use the same ones.
const PATIENT: [&str; 2] = ["--set", "odometry.imu_wait_max_s=20"];
/// A drive of 12 s, four times as fast.
const SCANS: u32 = 60;
const RATE: [&str; 2] = ["--rate", "4"];
/// No drive of these tests may take longer.
const TIME_MAX: Duration = Duration::from_secs(60);
/// What a drive leaves that does not depend on who computed it.
const SAME: [&str; 6] = [
    "keyframes.tum",
    "map.pgm",
    "map.yaml",
    "odometry.csv",
    "odometry.tum",
    "trajectory.tum",
];

/// A drive under `randt up`, with programs of its own and a folder for all that it is given and
/// writes.
struct Trial {
    pipeline: Pipeline,
    programs: Programs,
    folder: tempfile::TempDir,
    log: PathBuf,
}

impl Trial {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            pipeline: Pipeline::new(name),
            programs: Programs::new(),
            log: log(folder.path(), SCANS),
            folder,
        }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn out(&self) -> PathBuf {
        self.at("out")
    }

    fn command(&self, more: &[&str]) -> Command {
        let mut command = self.programs.randt(&["up"]);
        self.pipeline.enter(&mut command);
        command.args(RATE).args(PATIENT).args(more);
        command.arg("--play").arg(&self.log);
        command.arg("--out").arg(self.out());
        command
    }

    /// Runs it; `then` is done to it once it has a map of some keyframes.
    fn drive(&self, more: &[&str], then: impl FnOnce(&Self)) -> Ended {
        self.begin(more, |it| {
            let journal = it.out().join("map.journal");
            until("keyframes", || keyframes(&journal).len() >= 3);
            then(it);
        })
    }

    /// Runs it; `then` is done to it as soon as it is there.
    fn begin(&self, more: &[&str], then: impl FnOnce(&Self)) -> Ended {
        let command = self.command(more);
        std::thread::scope(|scope| {
            let ended = scope.spawn(|| ended_within(command, TIME_MAX));
            until("randt up", || self.pid("up").is_some());
            then(self);
            ended.join().unwrap()
        })
    }

    /// The process of a stage that lives.
    fn pid(&self, name: &str) -> Option<u32> {
        let all = Registry::all(self.pipeline.domain());
        let mut living = all.into_iter().filter(|(_, lives)| *lives);
        let found = living.find(|(entry, _)| entry.name == name);
        found.map(|(entry, _)| entry.pid as u32)
    }

    fn signal(&self, name: &str, with: Signal) {
        signal(self.pid(name).unwrap(), with);
    }

    /// Its files are whole, nobody is left, and it ended with 3 because of this counter; gives its
    /// first case.
    fn lost(&self, ended: &Ended, counter: &str) -> String {
        assert_eq!(ended.code, Some(3), "{}", ended.stderr);
        assert!(
            ended.stderr_contains(&format!("{counter} ")),
            "{}",
            ended.stderr
        );
        self.is_whole();
        let count = &report(&self.out())["counters"][counter];
        assert_eq!(count["loss"], true, "{counter}: {count}");
        count["first"].as_str().unwrap_or_default().to_owned()
    }

    fn is_whole(&self) {
        let found = names(&self.out());
        for name in OUTPUTS {
            assert!(found.iter().any(|found| found == name), "{found:?}");
        }
        let all = Registry::all(self.pipeline.domain());
        let living = all.into_iter().filter(|(_, lives)| *lives).count();
        assert_eq!(living, 0, "processes are left");
    }

    /// Its poses and its map are those of `randt run`.
    fn is_as_computed(&self) {
        let alone = self.at("alone");
        let computed = run(&self.log, &alone, &PATIENT);
        assert_eq!(computed.code, Some(0), "{}", computed.stderr);
        same(&self.out(), &alone);
    }
}

fn same(found: &Path, expected: &Path) {
    for name in SAME {
        let [found, expected] = [found, expected].map(|folder| folder.join(name));
        assert!(
            fs::read(&found).unwrap() == fs::read(expected).unwrap(),
            "{}: not what randt run gives",
            found.display()
        );
    }
}

#[test]
fn a_recorder_that_cannot_start_takes_nobody_with_it() {
    let trial = Trial::new("norec");
    trial.programs.remove("recorder");
    let logs = trial.at("logs");
    let ended = trial.drive(&["--record", logs.to_str().unwrap()], |_| {});
    let why = trial.lost(&ended, "stage_failures");
    assert!(why.contains("randt-recorder"), "{why}");
    let count = ended.stderr.matches("tried again").count();
    assert_eq!(count, 1, "once: {}", ended.stderr);
    trial.is_as_computed();
}

#[test]
fn a_recorder_that_cannot_write_and_a_view_that_fails_take_nobody_with_them() {
    let trial = Trial::new("norec2");
    trial.programs.break_down("view", "the port is taken");
    // Its folder is below a file.
    let logs = trial.log.join("logs");
    let ended = trial.drive(&["--view", "--record", logs.to_str().unwrap()], |_| {});
    let why = trial.lost(&ended, "stage_failures");
    assert_eq!(why, "randt-view: the port is taken");
    let why = trial.lost(&ended, "recording_incomplete");
    assert!(why.contains("did not come onto the disk"), "{why}");
    trial.is_as_computed();
}

/// Runs trials side by side: they sleep most of the time.
fn side_by_side<T: Sync>(cases: &[T], check: impl Fn(&T) + Sync) {
    std::thread::scope(|scope| {
        let check = &check;
        for case in cases {
            scope.spawn(move || check(case));
        }
    });
}

#[test]
fn a_stage_that_does_not_come_back_leaves_what_there_was() {
    side_by_side(&["filter", "odometry", "mapper"], |stage| {
        let trial = Trial::new("gone");
        let ended = trial.drive(&[], |trial| {
            trial.programs.break_down(stage, "no memory left");
            trial.signal(stage, Signal::KILL);
        });
        let why = trial.lost(&ended, "stage_failures");
        assert_eq!(why, format!("randt-{stage}: no memory left"));
        let scans = report(&trial.out())["scans"].as_u64().unwrap();
        let is_all = scans == u64::from(SCANS);
        assert!(
            scans > 3 && is_all == (*stage == "mapper"),
            "{stage}: {scans}"
        );
        // The ring has what the mapper did not take.
        if *stage == "mapper" {
            trial.is_as_computed();
        }
    });
}

#[test]
fn a_stage_that_cannot_start_at_all_ends_it_before_anything_is_played() {
    let trial = Trial::new("nostart");
    trial.programs.break_down("odometry", "too old a processor");
    let ended = trial.begin(&[], |_| {});
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    let last = ended.stderr.lines().last().unwrap();
    assert_eq!(last, "error: randt-odometry: too old a processor");
    assert!(!trial.out().join("report.json").exists());
    assert_eq!(trial.pid("mapper"), None);
}

#[test]
fn a_folder_of_outputs_that_is_removed_is_made_again() {
    let trial = Trial::new("noout");
    let ended = trial.drive(&[], |trial| remove_folder(&trial.out()));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        ended.stderr_contains("it is written again"),
        "{}",
        ended.stderr
    );
    trial.is_whole();
    trial.is_as_computed();
    let journal = keyframes(&trial.out().join("map.journal"));
    assert!(journal.len() > 3, "{journal:?}");

    // The journal alone.
    let trial = Trial::new("nojnl");
    let journal = trial.out().join("map.journal");
    let ended = trial.drive(&[], |_| fs::remove_file(&journal).unwrap());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(journal.is_file());
    trial.is_as_computed();
}

#[test]
fn where_nothing_can_be_written_it_ends_with_an_error() {
    let trial = Trial::new("nowhere");
    let ended = trial.drive(&[], |trial| {
        // The stages make the folder anew at any moment.
        while fs::write(trial.out(), "in the way").is_err() {
            remove_folder(&trial.out());
        }
    });
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    let output = ended.stderr.lines().last().unwrap();
    assert!(
        output.starts_with("error: ") && output.contains("out: cannot be made"),
        "{output}"
    );
    assert_eq!(fs::read_to_string(trial.out()).unwrap(), "in the way");
}

#[test]
fn a_run_folder_that_is_removed_costs_what_is_under_way_at_most() {
    let trial = Trial::new("norun");
    let run = trial.pipeline.domain().run().to_owned();
    let ended = trial.drive(&[], |_| remove_folder(&run));
    let why = trial.lost(&ended, "memory_gone");
    assert!(why.contains("was removed or cut"), "{why}");
    // Everybody comes back (tests/shared_memory.rs), and the log is played to its end.
    assert!(!ended.stderr_contains("interrupted"), "{}", ended.stderr);
}

#[test]
fn a_log_that_is_gone_at_the_end_costs_what_only_it_knows() {
    let trial = Trial::new("nolog");
    let copy = trial.at("copy.mcap");
    fs::copy(&trial.log, &copy).unwrap();
    let ended = trial.drive(&[], |trial| fs::remove_file(&trial.log).unwrap());
    let why = trial.lost(&ended, "log_gone");
    assert!(why.contains("log-1.mcap"), "{why}");
    fs::rename(copy, &trial.log).unwrap();
    trial.is_as_computed();
}

fn signal_if_there(pid: u32, with: Signal) {
    let pid = rustix::process::Pid::from_raw(pid as i32).unwrap();
    // It may have ended in this moment.
    let _ = rustix::process::kill_process(pid, with);
}

#[test]
fn a_closed_terminal_and_a_second_ctrl_c_end_it_with_its_results() {
    let cases = [
        &[Signal::HUP] as &[Signal],
        &[Signal::TERM],
        // Somebody who is impatient.
        &[Signal::INT, Signal::INT, Signal::HUP, Signal::TERM],
    ];
    side_by_side(&cases, |signals| {
        let trial = Trial::new("signal");
        let ended = trial.drive(&[], |trial| {
            let up = trial.pid("up").unwrap();
            signal(up, signals[0]);
            let exe = PathBuf::from(format!("/proc/{up}/exe"));
            let own = trial.programs.randt(&[]).get_program().to_owned();
            // Until it is gone, while it writes its files too.
            while signals.len() > 1 && fs::read_link(&exe).is_ok_and(|exe| exe == *own) {
                for with in *signals {
                    signal_if_there(up, *with);
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
        });
        let why = trial.lost(&ended, "interrupted");
        assert!(why.contains("not played to its end"), "{signals:?}: {why}");
    });
}

#[test]
fn an_interruption_before_the_pipeline_runs_leaves_nobody() {
    let trial = Trial::new("early");
    let ended = trial.begin(&[], |trial| trial.signal("up", Signal::INT));
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(
        ended.stderr_contains("nothing was computed"),
        "{}",
        ended.stderr
    );
    let all = Registry::all(trial.pipeline.domain());
    assert!(all.iter().all(|(_, lives)| !lives), "{all:?}");
}

#[test]
fn a_second_drive_into_a_folder_keeps_the_first_one() {
    let trial = Trial::new("twice");
    let out = trial.out();
    let mut earlier = Vec::new();
    for number in 1..=3 {
        let ended = trial.drive(&[], |_| {});
        assert!([Some(0), Some(3)].contains(&ended.code), "{}", ended.stderr);
        let kept = ended.stderr_contains("holds an earlier drive");
        assert_eq!(kept, number > 1, "{}", ended.stderr);
        let files = OUTPUTS.iter().chain(&["map.journal"]);
        let bytes = files.map(|name| (*name, fs::read(out.join(name)).unwrap()));
        earlier.push(bytes.collect::<Vec<_>>());
    }
    // What `randt run` writes there moves the results, and nothing of the journal.
    let ended = run(&trial.log, &out, &PATIENT);
    assert!(ended.stderr_contains("before-3"), "{}", ended.stderr);
    for (number, files) in earlier.iter().enumerate() {
        let before = out.join(format!("before-{}", number + 1));
        for (name, bytes) in files {
            let kept = match *name {
                "map.journal" if number == 2 => out.join(name),
                name => before.join(name),
            };
            assert!(fs::read(&kept).unwrap() == *bytes, "{}", kept.display());
        }
    }
}

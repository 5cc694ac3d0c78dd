//! Long forms, on a radio that is away for minutes: `cargo test --test programs link::long --
//! --ignored --nocapture`.

use super::ends::Robot;
use super::heard::{Heard, check_map};
use super::over_radio::{Ages, OverRadio, listen_for, now_ns};
use crate::support::pipeline::log;
use crate::support::stages::program;
use crate::support::{ended_within, randt};
use rustix::process::Signal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A mapper at the base and 512 kbit/s.
struct LongDrive {
    over: OverRadio,
    journal: PathBuf,
    mapper: u32,
    _input: tempfile::TempDir,
}

impl LongDrive {
    fn new(seconds: u32) -> Option<Self> {
        let input = tempfile::tempdir().unwrap();
        let log = input.path().join("long.mcap");
        let mut command = randt(&["simulate", "building", "--scans"]);
        command
            .arg((5 * seconds).to_string())
            .arg("--out")
            .arg(&log);
        let made = ended_within(command, Duration::from_secs(600));
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let how = "rate=64000 delay=0.05";
        let mut over = OverRadio::new(&log, how, "mapper = \"base\"")?;
        let journal = over.ends.folder.path().join("base.journal");
        let mapper = over.ends.base.mapper(&journal);
        let mut drive = Self {
            over,
            journal,
            mapper,
            _input: input,
        };
        drive.wait(60.0, Self::has_all);
        Some(drive)
    }

    fn has_all(both: &[Heard; 2]) -> bool {
        let keyframes = both[0].keyframe.len() as u64;
        both[1]
            .graph
            .is_some_and(|it| it.on_disk == keyframes && keyframes > 0)
    }

    /// Waits for something that may take minutes; gives how long it took, s.
    fn wait(&mut self, most_s: f64, mut holds: impl FnMut(&[Heard; 2]) -> bool) -> f64 {
        let begin = Instant::now();
        loop {
            listen_for(Duration::from_millis(100), &mut self.over.both);
            let took_s = begin.elapsed().as_secs_f64();
            if holds(&self.over.both) {
                return took_s;
            }
            assert!(took_s < most_s, "not after {took_s} s");
        }
    }

    /// A break; in the middle of a long one filter, odometry, the robot's end and the base's mapper
    /// are killed.
    fn break_for(&mut self, break_s: u64) {
        self.over.radio.set("down=1");
        let half = Duration::from_secs(break_s) / 2;
        listen_for(half, &mut self.over.both);
        if break_s > 1 {
            self.over.ends.base.end(self.mapper, Signal::KILL);
            self.over.ends.kill_link(Robot);
            let command = self.over.radio.at(0, &program("link"));
            self.over.ends.link_by(Robot, command);
            self.over.restart("odometry");
            self.over.restart("filter");
            self.mapper = self.over.ends.base.mapper(&self.journal);
        }
        listen_for(half, &mut self.over.both);
        let before = self.over.radio.set("down=0");
        let after_ns = now_ns(&self.over.both[1]);
        let [robot, base] = &self.over.both;
        let lacks = robot.keyframe.len() - base.keyframe.len();
        let state = base.state.len();
        let heard_s = self.wait(600.0, |both| both[1].state.len() > state);
        let took_s = self.wait(600.0, Self::has_all) + heard_s;
        let after = self.over.radio.set("");
        println!(
            "break of {break_s} s: {lacks} keyframes behind, first state after {heard_s:.1} s, \
             all after {took_s:.1} s, {:.0} B/s",
            (after[0] - before[0]) as f64 / took_s
        );
        Ages::new(&self.over.both, after_ns).print("meanwhile");
    }

    /// Keyframes and map are the robot's.
    fn check(&mut self) {
        let [robot, base] = &self.over.both;
        assert_eq!(base.keyframe, robot.keyframe);
        self.wait(60.0, |both| both[1].nodes.len() == both[0].keyframe.len());
        let journal = self.over.ends.folder.path().join("link.journal");
        check_map(&self.over.both[1], &journal);
    }
}

#[test]
#[ignore = "takes six minutes"]
fn a_third_of_all_packets_lost_other_orders_and_breaks_leave_the_map_whole() {
    let Some(mut drive) = LongDrive::new(400) else {
        return;
    };
    drive.over.measure("512 kbit/s", Duration::from_secs(30));
    drive.over.radio.set("delay=0.3 loss=0.05 swap=0.05");
    let what = "300 ms, loss 5 %, other order";
    drive.over.measure(what, Duration::from_secs(40));
    drive.over.radio.set("loss=0.3");
    let what = "300 ms, loss 30 %, other order";
    drive.over.measure(what, Duration::from_secs(60));
    drive.over.radio.set("delay=0.05 loss=0 swap=0");
    let took_s = drive.wait(600.0, LongDrive::has_all);
    println!("after it: all after {took_s:.1} s");
    drive.break_for(1);
    drive.break_for(60);
    drive.check();
}

#[test]
#[ignore = "takes a minute"]
fn the_radio_has_no_more_bytes_than_the_greatest_rate() {
    const MEASURED: Duration = Duration::from_secs(15);
    let input = tempfile::tempdir().unwrap();
    let log = log(input.path(), 200);
    for rate_max in [6_000, 12_000] {
        let more = format!("rate_max = {rate_max}.0");
        let Some(mut over) = OverRadio::new(&log, "delay=0.02", &more) else {
            return;
        };
        // What has come to wait meanwhile is more than either takes.
        listen_for(Duration::from_secs(8), &mut over.both);
        let what = format!("{rate_max} B/s at most");
        let (oldest, rate) = over.measure(&what, MEASURED);
        assert!(rate <= f64::from(rate_max), "{rate}");
        assert!(rate > 0.7 * f64::from(rate_max), "{rate}");
        assert!(oldest < 1.0, "{oldest}");
    }
}

#[test]
#[ignore = "takes a quarter of an hour"]
fn a_break_of_ten_minutes_is_caught_up_within_ten_minutes() {
    let Some(mut drive) = LongDrive::new(900) else {
        return;
    };
    drive.break_for(600);
    drive.check();
}

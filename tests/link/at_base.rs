//! What robots cost at a base: `cargo test --test programs link::at_base -- --ignored --nocapture`.

use super::ends::{Base, Ends, Robot, keys};
use crate::support::pipeline::log;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// How many robots there are in turn.
const ROBOTS: [usize; 3] = [1, 3, 5];
/// The first map of each window needs some seconds.
const WARM_UP: Duration = Duration::from_secs(8);
const MEASURED: Duration = Duration::from_secs(30);
/// Scans of the drive that each robot replays, at 5 Hz: the first one to start still drives at the
/// end.
const SCANS: u32 = 350;
/// What is extrapolated to.
const MANY: f64 = 50.0;

/// A robot that replays a drive, and what is at the base for it.
struct AtBase {
    ends: Ends,
    /// The base's end, and the mapper, which could as well be at the base.
    link: u32,
    mapper: u32,
}

/// Processor time in s, memory in bytes and bytes that came.
#[derive(Clone, Copy, Default)]
struct Cost {
    link_s: f64,
    mapper_s: f64,
    link_bytes: f64,
    mapper_bytes: f64,
    received: f64,
}

impl AtBase {
    fn new(log: &Path) -> Self {
        let mut ends = Ends::new("");
        let folder = ends.folder.path().to_owned();
        for (end, name) in [(Robot, "spot"), (Base, "base")] {
            let all = folder.join("keys");
            keys(&all, name, "10");
            let path = ends.configuration(end);
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(path, format!("{text}keys = {:?}\n", all.join(name))).unwrap();
        }
        let mapper = ends.robot.mapper(&folder.join("map.journal"));
        ends.robot.stage("odometry");
        ends.robot.stage("filter");
        ends.link(Base);
        ends.link(Robot);
        ends.robot.play(log, &["--stay"]);
        let link = ends.links[Base as usize].unwrap();
        Self { ends, link, mapper }
    }

    fn cost(&self) -> Cost {
        assert!(self.ends.links.iter().all(Option::is_some));
        Cost {
            link_s: processor_s(self.link),
            mapper_s: processor_s(self.mapper),
            link_bytes: memory_bytes(self.link),
            mapper_bytes: memory_bytes(self.mapper),
            received: received_bytes(&self.ends.address),
        }
    }
}

/// Processor time of a process so far, s: of each of its threads.
fn processor_s(pid: u32) -> f64 {
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap();
    let of_task = |task: std::io::Result<std::fs::DirEntry>| -> f64 {
        let text = std::fs::read_to_string(task.unwrap().path().join("schedstat")).unwrap();
        text.split(' ').next().unwrap().parse().unwrap()
    };
    tasks.map(of_task).sum::<f64>() / 1e9
}

/// Memory of a process, with its share of what it has together with others.
fn memory_bytes(pid: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).unwrap();
    let line = text.lines().find(|line| line.starts_with("Pss:")).unwrap();
    let kilobytes = line.split_whitespace().nth(1).unwrap();
    1024.0 * kilobytes.parse::<f64>().unwrap()
}

/// Bytes that came to a base's port, without their packets' heads.
fn received_bytes(address: &str) -> f64 {
    let (_, port) = address.split_once(':').unwrap();
    let mut listed = Command::new("ss");
    listed.args(["-H", "-t", "-n", "-i", "sport", "=", &format!(":{port}")]);
    let text = String::from_utf8(listed.output().unwrap().stdout).unwrap();
    let (_, rest) = text.split_once("bytes_received:").unwrap();
    rest.split(' ').next().unwrap().parse().unwrap()
}

#[test]
#[ignore = "takes three minutes"]
fn what_a_robot_costs_at_a_base() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), SCANS);
    let mut rows = Vec::new();
    for count in ROBOTS {
        let robots: Vec<AtBase> = (0..count).map(|_| AtBase::new(&log)).collect();
        std::thread::sleep(WARM_UP);
        let before: Vec<Cost> = robots.iter().map(AtBase::cost).collect();
        let begin = Instant::now();
        std::thread::sleep(MEASURED);
        let took_s = begin.elapsed().as_secs_f64();
        let after: Vec<Cost> = robots.iter().map(AtBase::cost).collect();
        let mut all = Cost::default();
        for (before, after) in before.iter().zip(&after) {
            all.link_s += (after.link_s - before.link_s) / took_s;
            all.mapper_s += (after.mapper_s - before.mapper_s) / took_s;
            all.link_bytes += after.link_bytes;
            all.mapper_bytes += after.mapper_bytes;
            all.received += (after.received - before.received) / took_s;
        }
        all.print(&format!("{count} robots"));
        rows.push((count as f64, all));
    }
    let of = |value: fn(&Cost) -> f64| many(&rows, value);
    let many = Cost {
        link_s: of(|it| it.link_s),
        mapper_s: of(|it| it.mapper_s),
        link_bytes: of(|it| it.link_bytes),
        mapper_bytes: of(|it| it.mapper_bytes),
        received: of(|it| it.received),
    };
    many.print("50 robots, by the slope");
    assert!(rows.iter().all(|(_, cost)| cost.received > 1000.0));
}

impl Cost {
    fn print(&self, what: &str) {
        println!(
            "{what}: link {:.1} % of a core, {:.1} MB, {:.1} kB/s; mapper {:.1} %, {:.1} MB",
            100.0 * self.link_s,
            1e-6 * self.link_bytes,
            1e-3 * self.received,
            100.0 * self.mapper_s,
            1e-6 * self.mapper_bytes,
        );
    }
}

/// By the straight line through all of them, as least squares have it.
fn many(rows: &[(f64, Cost)], value: fn(&Cost) -> f64) -> f64 {
    let count = rows.len() as f64;
    let mean = rows.iter().map(|row| row.0).sum::<f64>() / count;
    let mean_value = rows.iter().map(|row| value(&row.1)).sum::<f64>() / count;
    let (mut product, mut square) = (0.0, 0.0);
    for (robots, cost) in rows {
        product += (robots - mean) * (value(cost) - mean_value);
        square += (robots - mean) * (robots - mean);
    }
    mean_value + product / square * (MANY - mean)
}

//! What `randt-ros2` costs: processor time, and the latency that it adds; with Fast DDS on the
//! other side.
//!
//! `cargo test --release --workspace --test programs -- --ignored --nocapture ros2_cost` takes four
//! minutes behind the build; without `--release` processor time is printed and not judged.

use crate::ros2::fast_dds;
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::ros2_nodes::{Nodes, TOPICS, in_own_network};
use randt_messages::{Header, ImuSampleTopic, OdometryStateTopic, RadarScan, Topic};
use randt_stage::{Stage, Subscriber};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

const ROUNDS: usize = 3;
const ROUND_S: u64 = 20;
/// What is allowed: share of a core, and added latency, ms.
const CPU_MAX: f64 = 0.05;
const MEDIAN_MAX_MS: f64 = 2.0;
const P99_MAX_MS: f64 = 5.0;
/// The learning of the radar's turn is no steady state.
const WARM_UP: Duration = Duration::from_secs(4);

/// Stamps on the bus, and when each was published.
struct Bus {
    stage: Stage,
    scans: Subscriber<RadarScan>,
    samples: Subscriber<ImuSampleTopic>,
    states: Subscriber<OdometryStateTopic>,
    seen: Seen,
}

/// Stamps and when each was published, ns.
#[derive(Default)]
struct Seen {
    scans: BTreeMap<i64, i64>,
    samples: BTreeMap<i64, i64>,
    states: BTreeMap<i64, i64>,
}

impl Bus {
    fn enter(pipeline: &Pipeline) -> Self {
        let mut stage = Stage::open("observer", pipeline.domain()).unwrap();
        let mut bus = Self {
            scans: stage.subscriber().unwrap(),
            samples: stage.subscriber().unwrap(),
            states: stage.subscriber().unwrap(),
            stage,
            seen: Seen::default(),
        };
        bus.stage.running().unwrap();
        bus
    }

    fn listen(&mut self, time: Duration) {
        let begin = Instant::now();
        while begin.elapsed() < time {
            let seen = &mut self.seen;
            take(&mut self.scans, &mut seen.scans, |head| &head.header);
            take(&mut self.samples, &mut seen.samples, |head| &head.header);
            take(&mut self.states, &mut seen.states, |head| &head.header);
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

fn take<T: Topic>(
    from: &mut Subscriber<T>,
    seen: &mut BTreeMap<i64, i64>,
    header: impl Fn(&T::Head) -> &Header,
) {
    while let Some(received) = from.receive().unwrap() {
        let header = header(received.message().head);
        seen.insert(header.stamp_ns, header.published_ns);
    }
}

/// Median and 99th percentile of differences, ms.
fn latency(name: &str, pairs: impl Iterator<Item = (i64, i64)>) -> [f64; 2] {
    let mut all: Vec<f64> = pairs.map(|(from, to)| (to - from) as f64 / 1e6).collect();
    all.sort_by(f64::total_cmp);
    let at = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
    let found = [at(0.5), at(0.99)];
    println!(
        "{name}: {} messages, median {:.2} ms, p99 {:.2} ms",
        all.len(),
        found[0],
        found[1]
    );
    found
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

#[test]
#[ignore = "takes four minutes"]
fn what_it_costs() {
    if !in_own_network("ros2_cost::what_it_costs") {
        return;
    }
    let mut nodes = Nodes::new();
    let folder = tempfile::tempdir().unwrap();
    let fast = fast_dds(folder.path()).unwrap();
    let log = log(folder.path(), 5 * ROUND_S as u32);
    let mut own = [Vec::new(), Vec::new()];
    for round in 0..ROUNDS {
        for (with_bridge, found) in [false, true].into_iter().zip(&mut own) {
            found.push(beside_the_pipeline(&mut nodes, &log, with_bridge));
        }
        let [scans, samples, states, processor] = through(&mut nodes, &fast, folder.path());
        println!("round {round}: {:.1} % of a core", 100.0 * processor[0]);
        // The bound is for what a robot runs, in release.
        assert!(processor[0] < CPU_MAX || cfg!(debug_assertions));
        for [median_ms, p99_ms] in [scans, samples, states] {
            assert!(median_ms < MEDIAN_MAX_MS && p99_ms < P99_MAX_MS);
        }
    }
    println!("the pipeline's p99 without and with it, ms: {own:.2?}");
}

/// Sensors by Fast DDS, odometry back to it: latencies in, in, and out, and processor time.
fn through(nodes: &mut Nodes, fast: &Path, folder: &Path) -> [[f64; 2]; 4] {
    let mut pipeline = Pipeline::new("cost");
    let journal = tempfile::tempdir_in(folder).unwrap();
    pipeline.compute(journal.path());
    let bridge = nodes.bridge(&pipeline, &TOPICS);
    let mut bus = Bus::enter(&pipeline);
    let mut bench = Command::new(fast);
    bench.args(["bench", &(ROUND_S + WARM_UP.as_secs()).to_string()]);
    let bench = nodes.spawn("bench", bench);
    until("the bridge", || {
        bus.listen(Duration::from_millis(20));
        !bus.seen.scans.is_empty()
    });
    bus.listen(WARM_UP);
    bus.seen = Seen::default();
    let pid = nodes.children[bridge].id();
    let (begin, before_s) = (Instant::now(), processor_s(pid));
    bus.listen(Duration::from_secs(ROUND_S - 4));
    let share = (processor_s(pid) - before_s) / begin.elapsed().as_secs_f64();
    nodes.wait(bench, "bench");
    nodes.kill(bridge);
    let seen = &bus.seen;
    let pairs = |seen: &BTreeMap<i64, i64>| seen.clone().into_iter();
    let text = nodes.text("bench.out");
    let out = text.lines().filter_map(|line| {
        let (stamp_ns, came_ns) = line.split_once(' ')?;
        let published_ns = seen.states.get(&stamp_ns.parse().unwrap())?;
        Some((*published_ns, came_ns.parse().unwrap()))
    });
    [
        latency("clouds in", pairs(&seen.scans)),
        latency("IMU in", pairs(&seen.samples)),
        latency("odometry out", out),
        [share; 2],
    ]
}

/// The pipeline's own latency from sweep to state, p99, where a log is played, ms.
fn beside_the_pipeline(nodes: &mut Nodes, log: &Path, with_bridge: bool) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::new("beside");
    pipeline.compute(folder.path());
    let bridge = with_bridge.then(|| {
        nodes.cyclone("echo", &["echo"]);
        nodes.bridge(&pipeline, &[])
    });
    let mut bus = Bus::enter(&pipeline);
    pipeline.play(log, &[]);
    bus.listen(Duration::from_secs(ROUND_S));
    let states = bus.seen.states.iter();
    let pairs = states.filter_map(|(stamp_ns, to_ns)| {
        let from_ns = bus.seen.scans.get(stamp_ns)?;
        Some((*from_ns, *to_ns))
    });
    let [_, p99_ms] = latency(&format!("with the bridge {with_bridge}"), pairs);
    if let Some(bridge) = bridge {
        nodes.kill(bridge);
        nodes.kill(bridge - 1);
    }
    p99_ms
}

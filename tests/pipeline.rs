//! The stages as processes: in any order, side by side, and what they take of memory and calls.

use crate::support::stages::{RunFolder, Running, memory};
use crate::support::{Ended, calls, drive, ended, ended_within, randt, run};
use randt::pipeline::Pipeline;
use randt_config::Config;
use randt_mapper::journal::{self, Kind};
use randt_messages::{
    BUS_TOPICS, BusTopic, Header, Keyframe, Message, MessageRef, OdometryState, OdometryStateTopic,
    RadarScan, Topic,
};
use randt_odometry::Sink;
use randt_readers::Event;
use randt_stage::{Domain, Stage};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Other tests load the machine: a sample that comes late is waited for, so that both computations
/// use the same ones.
const PATIENT: &str = "odometry.imu_wait_max_s=20";
/// No pipeline of these tests may take longer.
const TIME_MAX: Duration = Duration::from_secs(180);

#[test]
fn memory_and_calls_stay_small_while_scans_flow() {
    let folder = RunFolder::new();
    let log = folder.file("drive.mcap");
    drive::write(&drive::events(75), &log);
    let domain = folder.domain("small");
    let (profile, _) = folder.profile(&log);
    let mut stages = ["mapper", "odometry", "filter"].map(|name| {
        let mut command = RunFolder::command(&domain, name);
        command.arg("--profile").arg(&profile);
        folder.start(name, command)
    });
    let mut command = RunFolder::command(&domain, "play");
    command.arg(&log);
    let begin = Instant::now();
    let mut play = folder.start("play", command);
    let before = stages.each_ref().map(Running::written);
    let mut most = 0;
    let mut traced = stages.each_ref().map(|_| None);
    // The mapper last: the robot stands at first, and there is nothing to write.
    for (stage, traced) in stages.iter().zip(&mut traced).rev() {
        std::thread::sleep(Duration::from_secs(2));
        *traced = calls::watch(stage, Duration::from_secs(2));
        most = memory(&domain).max(most);
    }
    while play.ended().is_none() {
        most = memory(&domain).max(most);
        std::thread::sleep(Duration::from_millis(100));
    }
    let seconds = begin.elapsed().as_secs_f64();
    let scans_kb = scans_kb(&log);
    println!(
        "scans {:.0} kB/s, memory {:.1} MB",
        scans_kb / seconds,
        most as f64 * 1e-6
    );
    // What flows would be seen if it were written: 600 kB for each second of the drive, which
    // lasts 15 s.
    assert!(scans_kb > 9_000.0, "{scans_kb}");
    assert!(most < 64_000_000, "{most}");
    for ((stage, before), traced) in stages.iter().zip(before).zip(traced) {
        let written = (stage.written() - before) as f64 * 1e-3 / seconds;
        println!("{}: {written:.1} kB/s written, {traced:?}", stage.name);
        assert!(written < 50.0, "{}: {written}", stage.name);
        match traced {
            Some(calls) => {
                let both = calls.written_kb_s + calls.sent_kb_s;
                assert!(both < 50.0, "{}: {calls:?}", stage.name);
                assert!(calls.writes_s + calls.sends_s > 0.0, "nothing was seen");
            }
            // Written bytes are the system's count; what is sent has none.
            None => assert!(std::env::var_os("CI").is_none(), "strace has to be there"),
        }
    }
    assert_budgets(stages.iter().chain([&play]));
    stages.iter_mut().for_each(end);
}

/// Each topic's budget was logged by the stage that writes it.
fn assert_budgets<'a>(programs: impl Iterator<Item = &'a Running>) {
    let output: Vec<(&str, String)> = programs.map(|p| (p.name.as_str(), p.stderr())).collect();
    let writer = |topic: &BusTopic| match topic.name.split('/').next().unwrap() {
        "imu" | "robot" => "play",
        "radar" if topic.name == RadarScan::NAME => "play",
        "radar" => "filter",
        "odometry" => "odometry",
        "mapper" => "mapper",
        // Each of them.
        _ => "filter",
    };
    for topic in BUS_TOPICS {
        let name = writer(topic);
        let output = &output
            .iter()
            .find(|(program, _)| *program == name)
            .unwrap()
            .1;
        let line = output.lines().find(|line| line.contains(topic.name));
        let line = line.unwrap_or_else(|| panic!("{}: no budget in: {output}", topic.name));
        assert!(line.contains("MB") && line.contains("history"), "{line}");
    }
}

/// Bytes of a log's scans as they are on the bus, kB.
fn scans_kb(log: &Path) -> f64 {
    let mut source = randt_readers::open(log, &randt_readers::Options::default()).unwrap();
    let mut bytes = 0;
    while let Some(event) = source.next_event().unwrap() {
        if let Event::Scan(scan) = event {
            bytes += size_of::<<RadarScan as Topic>::Head>() + size_of_val(scan.items.as_slice());
        }
    }
    bytes as f64 * 1e-3
}

/// A stage that comes late takes from the histories what it missed: scans of 6 s, samples of 8 s.
/// All that happens here happens within that; keyframes are in a ring for minutes, and the mapper
/// asks for them.
#[test]
fn stages_start_in_any_order_and_nothing_is_missing() {
    let folder = RunFolder::new();
    let log = folder.file("drive.mcap");
    drive::write(&drive::events(40), &log);
    let (profile, mut config) = folder.profile(&log);
    config.odometry.imu_wait_max_s = 20.0;
    let expected = Expected::by_replay(&log, &config);
    assert!(expected.states.len() >= 39 && expected.keyframes.len() >= 3);
    let short = Duration::from_millis(200);
    let long = Duration::from_millis(2_200);
    let orders = [
        (["filter", "odometry", "mapper"], short),
        (["filter", "mapper", "odometry"], short),
        (["odometry", "filter", "mapper"], short),
        (["odometry", "mapper", "filter"], short),
        (["mapper", "filter", "odometry"], short),
        (["mapper", "odometry", "filter"], short),
        (["filter", "odometry", "mapper"], long),
        (["mapper", "odometry", "filter"], long),
    ];
    std::thread::scope(|scope| {
        for (number, (order, gap)) in orders.into_iter().enumerate() {
            let (folder, log, profile, expected) = (&folder, &log, &profile, &expected);
            scope.spawn(move || {
                let domain = folder.domain(&format!("order{number}"));
                start_in_order(folder, &domain, order, gap, [log, profile], expected);
            });
        }
    });
}

fn start_in_order(
    folder: &RunFolder,
    domain: &Domain,
    order: [&str; 3],
    gap: Duration,
    [log, profile]: [&PathBuf; 2],
    expected: &Expected,
) {
    let mut observer = Stage::open("observer", domain).unwrap();
    let mut states_in = observer.subscriber::<OdometryStateTopic>().unwrap();
    observer.running().unwrap();
    // The drivers run from the beginning on.
    let mut command = RunFolder::command(domain, "play");
    command.arg(log).arg("--stay");
    let mut play = folder.start("play", command);
    let journal = folder.file(&format!("{}.journal", domain.prefix()));
    let mut stages = order.map(|name| {
        if name != order[0] {
            observer.wait(&[], Some(gap)).unwrap();
        }
        let mut command = RunFolder::command(domain, name);
        command
            .arg("--profile")
            .arg(profile)
            .args(["--set", PATIENT]);
        if name == "mapper" {
            command.arg("--journal").arg(&journal);
        }
        folder.start(name, command)
    });
    let begin = Instant::now();
    let mut states = Vec::new();
    while states.len() < expected.states.len() {
        assert!(
            begin.elapsed() < TIME_MAX,
            "{order:?}: {} of {} states\n{}",
            states.len(),
            expected.states.len(),
            stages.each_ref().map(Running::stderr).concat()
        );
        observer
            .wait(&[&states_in], Some(Duration::from_millis(100)))
            .unwrap();
        while let Some(state) = states_in.receive().unwrap() {
            states.push(bare(state.message().head));
        }
    }
    assert_eq!(states, expected.states, "{order:?}");
    // The mapper asks twice a second for what it misses.
    let keyframes = loop {
        let keyframes = fs::read(&journal).map_or(Vec::new(), |bytes| keyframes_in(&bytes));
        if keyframes.len() >= expected.keyframes.len() {
            break keyframes;
        }
        assert!(
            begin.elapsed() < TIME_MAX,
            "{order:?}: {} of {} keyframes",
            keyframes.len(),
            expected.keyframes.len()
        );
        observer
            .wait(&[], Some(Duration::from_millis(100)))
            .unwrap();
    };
    assert!(keyframes == expected.keyframes, "{order:?}");
    println!(
        "{order:?} {gap:?} apart: {} states, {} keyframes",
        states.len(),
        keyframes.len()
    );
    end(&mut play);
    stages.iter_mut().for_each(end);
    observer.close().unwrap();
}

/// What the stages have to give, computed in one thread, up to the last event: the end of a log is
/// nothing that a stage knows of.
#[derive(Default)]
struct Expected {
    states: Vec<OdometryState>,
    keyframes: Vec<Message<Keyframe>>,
}

impl Expected {
    fn by_replay(log: &Path, config: &Config) -> Self {
        let mut expected = Self::default();
        let mut pipeline = Pipeline::new(config, true);
        let mut source = randt_readers::open(log, &randt_readers::Options::default()).unwrap();
        while let Some(event) = source.next_event().unwrap() {
            pipeline.push(&event, &mut expected);
        }
        expected
    }
}

impl Sink for Expected {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(bare(state));
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        let mut copy = Message::<Keyframe>::default();
        *copy.head = *keyframe.head;
        copy.items.extend_from_slice(keyframe.items);
        self.keyframes.push(without_journey(copy));
    }
}

/// A state without what is of its journey: who sent it and its inputs, and when.
fn bare(state: &OdometryState) -> OdometryState {
    let mut bare = *state;
    bare.header = Header {
        stamp_ns: state.header.stamp_ns,
        ..Header::default()
    };
    (bare.scan_epoch, bare.scan_published_ns) = (0, 0);
    (bare.imu_epoch, bare.imu_published_ns) = (0, 0);
    bare
}

fn without_journey(mut keyframe: Message<Keyframe>) -> Message<Keyframe> {
    keyframe.head.header = Header {
        stamp_ns: keyframe.head.header.stamp_ns,
        ..Header::default()
    };
    keyframe
}

/// The keyframes of a journal, in its order.
fn keyframes_in(bytes: &[u8]) -> Vec<Message<Keyframe>> {
    let Ok((_, records)) = journal::records(bytes) else {
        return Vec::new();
    };
    let keyframes = records.of_kind(Kind::Keyframe).map(|record| {
        let mut keyframe = Message::default();
        assert!(journal::read_keyframe(record.payload, &mut keyframe));
        without_journey(keyframe)
    });
    keyframes.collect()
}

fn end(running: &mut Running) {
    let status = running.stop();
    assert!(
        status.success(),
        "randt-{}: {status}: {}",
        running.name,
        running.stderr()
    );
}

/// The files that a log has to give, in whatever company.
const POSES: [&str; 5] = [
    "keyframes.tum",
    "map.pgm",
    "map.yaml",
    "odometry.tum",
    "trajectory.tum",
];

#[test]
fn two_pipelines_in_one_folder_do_not_see_each_other() {
    let folder = RunFolder::new();
    // The second one is longer: the first one is wiped while it runs.
    let drives = [("left", "3", "40"), ("right", "5", "60")].map(|(name, seed, scans)| {
        let log = folder.file(&format!("{name}.mcap"));
        let mut command = randt(&["simulate", "building", "--seed", seed, "--scans", scans]);
        command.arg("--out").arg(&log);
        assert_good(&ended(command));
        let alone = folder.file(&format!("{name}-alone"));
        assert_good(&run(&log, &alone, &["--set", PATIENT]));
        (folder.domain(name), log, alone, folder.file(name))
    });
    std::thread::scope(|scope| {
        let [left, right] = drives.each_ref().map(|(domain, log, _, out)| {
            scope.spawn(move || {
                let mut command = randt(&["up", "--set", PATIENT, "--prefix", domain.prefix()]);
                command.arg("--run").arg(domain.run());
                command.arg("--play").arg(log).arg("--out").arg(out);
                ended_within(command, TIME_MAX)
            })
        });
        assert_good(&left.join().unwrap());
        let [left, other] = drives.each_ref().map(|(domain, ..)| domain);
        let wiped = randt_stage::wipe(left, true).unwrap();
        assert!(wiped.is_some_and(|files| !files.is_empty()), "it has ended");
        assert!(!right.is_finished(), "the other one has to be running");
        let refused = randt_stage::wipe(other, true).unwrap();
        assert!(refused.is_none(), "it runs");
        assert_good(&right.join().unwrap());
    });
    for (_, _, alone, together) in &drives {
        for name in POSES {
            let [alone, together] = [alone, together].map(|folder| folder.join(name));
            assert!(
                fs::read(alone).unwrap() == fs::read(&together).unwrap(),
                "{}: not what randt run gives",
                together.display()
            );
        }
    }
}

fn assert_good(ended: &Ended) {
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}

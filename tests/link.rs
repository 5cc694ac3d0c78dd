//! `randt-link` between two pipelines: a robot's topics on a base's bus, a mapper at the base, keys
//! that are refused, and a bad radio between two network namespaces.

use crate::support::ended;
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::radio::{ADDRESS, Radio};
use crate::support::stages::program;
use randt_config::Config;
use randt_mapper::Mapper;
use randt_mapper::publication::fill_graph;
use randt_messages::{
    GraphEntry, GraphEntryKind, Header, Keyframe, MapperCorrection, MapperGraph, MapperGrid,
    Message, OdometryState, OdometryStateTopic, StageHealth, StageHealthTopic, health::text_of,
};
use randt_stage::{Observer, Subscriber};
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// A robot's pipeline and the base's of it, and the link between them.
struct Ends {
    robot: Pipeline,
    base: Pipeline,
    folder: tempfile::TempDir,
    links: [Option<u32>; 2],
}

/// Which end.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Robot,
    Base,
}
use End::{Base, Robot};

impl Ends {
    /// Without a link yet. `more`: lines of the section `link` for both ends.
    fn new(more: &str) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap().to_string();
        Self::at(&address, more)
    }

    fn at(address: &str, more: &str) -> Self {
        let ends = Self {
            robot: Pipeline::new("lr"),
            base: Pipeline::new("lb"),
            folder: tempfile::tempdir().unwrap(),
            links: [None; 2],
        };
        for (end, role) in [(Robot, "robot"), (Base, "base")] {
            let text = format!(
                "[link]\nrole = \"{role}\"\nrobot = \"spot\"\naddress = \"{address}\"\n{more}\n"
            );
            std::fs::write(ends.configuration(end), text).unwrap();
        }
        ends
    }

    fn configuration(&self, end: End) -> PathBuf {
        self.folder
            .path()
            .join(["robot.toml", "base.toml"][end as usize])
    }

    fn pipeline(&mut self, end: End) -> &mut Pipeline {
        match end {
            Robot => &mut self.robot,
            Base => &mut self.base,
        }
    }

    /// Starts the link's process at one end.
    fn link(&mut self, end: End) {
        self.link_by(end, Command::new(program("link")));
    }

    fn link_by(&mut self, end: End, mut command: Command) {
        command.arg("--robot").arg(self.configuration(end));
        if end == Robot {
            command
                .arg("--journal")
                .arg(self.folder.path().join("link.journal"));
        }
        let pipeline = self.pipeline(end);
        pipeline.enter(&mut command);
        let name = ["link", "link-base"][end as usize];
        let pid = pipeline.start(name, command);
        self.links[end as usize] = Some(pid);
    }

    fn kill_link(&mut self, end: End) {
        let pid = self.links[end as usize].take().unwrap();
        self.pipeline(end).end(pid, Signal::KILL);
    }
}

/// What a bus has.
struct Heard {
    observer: Observer,
    anchor_ns: i64,
    states: Subscriber<OdometryStateTopic>,
    keyframes: Subscriber<Keyframe>,
    corrections: Subscriber<MapperCorrection>,
    graphs: Subscriber<MapperGraph>,
    tiles: Subscriber<MapperGrid>,
    health: Subscriber<StageHealthTopic>,
    /// By number.
    state: BTreeMap<u64, OdometryState>,
    keyframe: BTreeMap<u64, Message<Keyframe>>,
    /// Numbers in the order in which they came.
    order: Vec<u64>,
    correction: Option<randt_messages::Correction>,
    graph: Option<randt_messages::GraphHead>,
    /// Nodes of the whole graph, as its pages came last.
    nodes: BTreeMap<u64, [f64; 3]>,
    tile: BTreeMap<(i32, i32), Vec<u8>>,
    stages: BTreeMap<String, StageHealth>,
    /// When each state, health and correction came: topic, what tells it, the robot's stamp of its
    /// publishing or zero, and when it was published here, all by the clock since the boot, ns.
    came: Vec<(&'static str, u64, i64, i64)>,
}

impl Heard {
    fn enter(pipeline: &Pipeline) -> Self {
        let observer = Observer::enter(pipeline.domain()).unwrap().unwrap();
        Self {
            anchor_ns: observer.clock().anchor_ns(),
            states: observer.subscriber().unwrap(),
            keyframes: observer.subscriber().unwrap(),
            corrections: observer.subscriber().unwrap(),
            graphs: observer.subscriber().unwrap(),
            tiles: observer.subscriber().unwrap(),
            health: observer.subscriber().unwrap(),
            observer,
            state: BTreeMap::new(),
            keyframe: BTreeMap::new(),
            order: Vec::new(),
            correction: None,
            graph: None,
            nodes: BTreeMap::new(),
            tile: BTreeMap::new(),
            stages: BTreeMap::new(),
            came: Vec::new(),
        }
    }

    fn listen(&mut self) {
        let o = &self.observer;
        let anchor_ns = self.anchor_ns;
        let at_ns = |header: &Header| header.published_ns - anchor_ns;
        o.read(&mut self.states, |message| {
            let head = message.head;
            if self.state.insert(head.id, *head).is_none() {
                self.came.push(("state", head.id, 0, at_ns(&head.header)));
            }
        })
        .unwrap();
        o.read(&mut self.keyframes, |message| {
            let id = message.head.id;
            let mut bytes = Vec::new();
            message.write_bytes(&mut bytes);
            let mut keyframe = Message::<Keyframe>::from_bytes(&bytes).unwrap();
            // The publisher's own.
            let header = &mut keyframe.head.header;
            (header.sequence, header.epoch, header.published_ns) = (0, 0, 0);
            if let Some(before) = self.keyframe.get(&id) {
                assert_eq!(before, &keyframe, "keyframe {id}");
            }
            self.keyframe.insert(id, keyframe);
            self.order.push(id);
        })
        .unwrap();
        o.read(&mut self.corrections, |message| {
            let head = message.head;
            self.correction = Some(*head);
            self.came
                .push(("correction", head.graph_version, 0, at_ns(&head.header)));
        })
        .unwrap();
        o.read(&mut self.graphs, |message| match message.items {
            [] => self.graph = Some(*message.head),
            entries => self.nodes.extend(nodes(entries)),
        })
        .unwrap();
        o.read(&mut self.tiles, |message| {
            let head = message.head;
            self.tile
                .insert((head.column, head.row), message.items.to_vec());
        })
        .unwrap();
        o.read(&mut self.health, |message| {
            let head = message.head;
            let name = text_of(&head.name).to_owned();
            self.came.push((
                "health",
                head.pid,
                head.header.stamp_ns,
                at_ns(&head.header),
            ));
            self.stages.insert(name, *head);
        })
        .unwrap();
    }
}

/// Listens to both until something holds.
fn listen_until(what: &str, both: &mut [Heard; 2], mut holds: impl FnMut(&[Heard; 2]) -> bool) {
    until(what, || {
        both.iter_mut().for_each(Heard::listen);
        std::thread::sleep(Duration::from_millis(20));
        holds(both)
    });
}

#[test]
fn a_robots_topics_are_on_the_bases_bus_whole_whichever_end_is_killed() {
    let mut ends = Ends::new("");
    let folder = ends.folder.path().to_owned();
    let input = log(&folder, 90);
    ends.robot.compute(&folder);
    ends.link(Robot);
    ends.link(Base);
    let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
    ends.robot.play(&input, &["--stay"]);
    for (end, keyframes) in [(Base, 4), (Robot, 8)] {
        listen_until("keyframes", &mut both, |both| {
            both[1].keyframe.len() >= keyframes
        });
        ends.kill_link(end);
        let there = both[0].keyframe.len();
        listen_until("keyframes meanwhile", &mut both, |both| {
            both[0].keyframe.len() >= there + 2
        });
        ends.link(end);
    }
    listen_until("the end of the drive", &mut both, |[robot, base]| {
        let ends = |heard: &Heard| heard.state.last_key_value().map(|(id, _)| *id);
        ends(robot) >= Some(89)
            && ends(base) == ends(robot)
            && base.keyframe.len() == robot.keyframe.len()
            && base.correction.map(|it| it.graph_version)
                == robot.correction.map(|it| it.graph_version)
            && base.tile == robot.tile
            && !base.tile.is_empty()
    });
    let [robot, base] = &both;
    assert_eq!(base.keyframe, robot.keyframe);
    let last = |heard: &Heard| heard.state.last_key_value().unwrap().1.pose;
    assert_eq!(last(base), last(robot));
    for stage in ["filter", "odometry", "mapper", "link", "link-base"] {
        assert!(base.stages.contains_key(stage), "{stage}");
    }
    // Each once but where an end was killed, and never backwards by more than that.
    let doubles = base.order.len() - base.keyframe.len();
    assert!(doubles <= 40, "{:?}", base.order);
}

/// Nodes of a graph by their number.
fn nodes(entries: &[GraphEntry]) -> BTreeMap<u64, [f64; 3]> {
    let kind = GraphEntryKind::Node as u32;
    let nodes = entries.iter().filter(|entry| entry.kind == kind);
    nodes.map(|entry| (entry.a, entry.pose)).collect()
}

/// The graph that a mapper on the robot would have made of the keyframes of the link's journal.
fn onboard(journal: &Path) -> BTreeMap<u64, [f64; 3]> {
    let bytes = std::fs::read(journal).unwrap();
    let (mapper, restored) = Mapper::restore(&Config::default(), &bytes).unwrap();
    assert_eq!(restored.from_snapshot, 0);
    let mut page = Message::default();
    let mut entries = Vec::new();
    let mut first = Some(0);
    while let Some(from) = first {
        first = fill_graph(&mapper, from, &mut page);
        entries.extend_from_slice(&page.items);
    }
    nodes(&entries)
}

/// Whether the base's mapper has what a mapper on the robot would have.
fn check_map(base: &Heard, journal: &Path) {
    let onboard = onboard(journal);
    assert!(onboard.len() > 5);
    assert_eq!(base.nodes.len(), onboard.len());
    for (id, pose) in &onboard {
        let there = base.nodes[id];
        let off = there.iter().zip(pose).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{id}: {there:?}, {pose:?}");
    }
}

#[test]
fn a_mapper_at_the_base_makes_the_robots_map_whatever_is_killed_meanwhile() {
    let mut ends = Ends::new("mapper = \"base\"");
    let folder = ends.folder.path().to_owned();
    let input = log(&folder, 110);
    ends.link(Robot);
    ends.robot.stage("odometry");
    ends.robot.stage("filter");
    ends.link(Base);
    let journal = folder.join("base.journal");
    let mut mapper = ends.base.mapper(&journal);
    let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
    ends.robot.play(&input, &["--stay"]);
    for step in 0..3 {
        let there = both[0].keyframe.len();
        listen_until("keyframes", &mut both, |both| {
            both[0].keyframe.len() >= there + 4
        });
        match step {
            0 => {
                ends.base.end(mapper, Signal::KILL);
                ends.kill_link(Base);
                ends.link(Base);
                mapper = ends.base.mapper(&journal);
            }
            1 => {
                ends.kill_link(Robot);
                ends.link(Robot);
            }
            _ => {
                ends.base.end(mapper, Signal::KILL);
                mapper = ends.base.mapper(&journal);
            }
        }
    }
    listen_until(
        "the whole map, and its correction on the robot",
        &mut both,
        |both| {
            let [robot, base] = both;
            let version = |heard: &Heard| heard.correction.map(|it| it.graph_version);
            let keyframes = robot.keyframe.len();
            robot
                .state
                .last_key_value()
                .is_some_and(|(id, _)| *id >= 109)
                && base.graph.is_some_and(|it| it.on_disk == keyframes as u64)
                && base.nodes.len() == keyframes
                && robot.graph.is_some_and(|it| it.on_disk == keyframes as u64)
                && version(robot) == version(base)
        },
    );
    let [robot, base] = &both;
    assert_eq!(base.keyframe, robot.keyframe);
    let place = |heard: &Heard| heard.correction.unwrap().map_from_odom;
    assert_eq!(place(robot), place(base));
    check_map(base, &folder.join("link.journal"));
}

/// Makes keys in a folder.
fn keys(folder: &Path, name: &str, days: &str) {
    let mut command = Command::new(program("link"));
    command.arg("keys").arg(folder).args([name, "--days", days]);
    let made = ended(command);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
}

#[test]
fn a_wrong_an_expired_and_a_refused_key_get_nothing_and_are_named() {
    let mut ends = Ends::new("");
    let folder = ends.folder.path().to_owned();
    let (right, other) = (folder.join("keys"), folder.join("other"));
    for name in ["base", "spot", "rover"] {
        keys(&right, name, "10");
    }
    keys(&other, "spot", "10");
    std::fs::rename(right.join("spot"), right.join("valid")).unwrap();
    keys(&right, "spot", "0");
    std::fs::rename(right.join("spot"), right.join("expired")).unwrap();
    let input = log(&folder, 30);
    ends.robot.compute(&folder);
    ends.robot.play(&input, &["--stay"]);
    let text = |ends: &Ends, end| std::fs::read_to_string(ends.configuration(end)).unwrap();
    let (robot, base) = (text(&ends, Robot), text(&ends, Base));
    let set = |ends: &Ends, end, text: &str, keys: &Path, more: &str| {
        let text = format!("{text}keys = {keys:?}\n{more}\n");
        std::fs::write(ends.configuration(end), text).unwrap();
    };
    for (key, more, words) in [
        (
            "other/spot",
            "",
            "the other end does not know this one's key",
        ),
        ("keys/expired", "", "its key has expired"),
        ("keys/rover", "", "refused: key of \"rover\", another one's"),
        (
            "keys/valid",
            "refused = \"spot\"",
            "refused: key of \"spot\", it is in link.refused",
        ),
        ("keys/valid", "", ""),
    ] {
        set(&ends, Robot, &robot, &folder.join(key), "");
        set(&ends, Base, &base, &right.join("base"), more);
        ends.link(Base);
        ends.link(Robot);
        let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
        listen_until(key, &mut both, |[_, base]| {
            let end = base.stages.get("link-base");
            let message = end.map_or("", |end| text_of(&end.message));
            match words {
                "" => !base.state.is_empty() && !base.keyframe.is_empty(),
                _ => message.contains(words),
            }
        });
        let heard = &both[1];
        if !words.is_empty() {
            let names: Vec<&String> = heard.stages.keys().collect();
            assert!(heard.state.is_empty() && heard.keyframe.is_empty(), "{key}");
            assert_eq!(names, ["link-base"], "{key}");
        }
        ends.kill_link(Robot);
        ends.kill_link(Base);
    }
}

/// What came over the link late: of each kind the ages on arrival, sorted, s.
struct Ages(BTreeMap<&'static str, Vec<f64>>);

impl Ages {
    /// Of what came at the base after an instant of its clock. Stamps of both ends are the boot's
    /// clock plus an anchor each.
    fn new([robot, base]: &[Heard; 2], after_ns: i64) -> Self {
        let mut ages = BTreeMap::<_, Vec<f64>>::new();
        let sent: BTreeMap<(&str, u64), i64> = robot
            .came
            .iter()
            .rev()
            .map(|(kind, id, _, at_ns)| ((*kind, *id), *at_ns))
            .collect();
        for (kind, id, stamp_ns, at_ns) in base.came.iter().filter(|it| it.3 > after_ns) {
            let sent_ns = match stamp_ns {
                0 => sent.get(&(*kind, *id)).copied(),
                // Only the robot's stages.
                stamp_ns => robot
                    .stages
                    .values()
                    .any(|stage| stage.pid == *id)
                    .then_some(stamp_ns - robot.anchor_ns),
            };
            if let Some(sent_ns) = sent_ns {
                let ages = ages.entry(*kind).or_default();
                ages.push((at_ns - sent_ns) as f64 * 1e-9);
            }
        }
        ages.values_mut()
            .for_each(|ages| ages.sort_by(f64::total_cmp));
        Self(ages)
    }

    /// Prints them; gives the oldest.
    fn print(&self, what: &str) -> f64 {
        let mut oldest = 0.0_f64;
        for (kind, ages) in &self.0 {
            let at = |share: f64| ages[((ages.len() - 1) as f64 * share) as usize];
            println!(
                "{what}: {kind}: {} came, median {:.3} s, p99 {:.3}, oldest {:.3}",
                ages.len(),
                at(0.5),
                at(0.99),
                at(1.0)
            );
            oldest = oldest.max(at(1.0));
        }
        oldest
    }
}

fn now_ns(heard: &Heard) -> i64 {
    heard.observer.clock().now_ns() - heard.anchor_ns
}

fn listen_for(time: Duration, both: &mut [Heard; 2]) {
    let end = Instant::now() + time;
    while Instant::now() < end {
        both.iter_mut().for_each(Heard::listen);
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A robot that drives and a base, with a radio between them.
struct OverRadio {
    ends: Ends,
    both: [Heard; 2],
    radio: Radio,
}

impl OverRadio {
    /// `None` where there can be none. `how`: the radio's settings from the start.
    fn new(input: &Path, how: &str, more: &str) -> Option<Self> {
        let mut radio = Radio::new()?;
        radio.set(how);
        let mut ends = Ends::at(&format!("{}:7447", ADDRESS[1]), more);
        let own = ends.folder.path().to_owned();
        for (end, name) in [(Robot, "spot"), (Base, "base")] {
            let folder = own.join("keys");
            keys(&folder, name, "10");
            let path = ends.configuration(end);
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(path, format!("{text}keys = {:?}\n", folder.join(name))).unwrap();
        }
        if more.is_empty() {
            ends.robot.mapper(&own.join("map.journal"));
        }
        ends.robot.stage("odometry");
        ends.robot.stage("filter");
        let program = program("link");
        ends.link_by(Base, radio.at(1, &program));
        ends.link_by(Robot, radio.at(0, &program));
        let both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
        ends.robot.play(input, &["--stay"]);
        Some(Self { ends, both, radio })
    }

    fn has_all(both: &[Heard; 2]) -> bool {
        both[1].keyframe.len() == both[0].keyframe.len()
    }

    /// Bytes a second from the robot and back, and the ages, in some time from now on.
    fn measure(&mut self, what: &str, time: Duration) -> (f64, f64) {
        self.both.iter_mut().for_each(Heard::listen);
        let after_ns = now_ns(&self.both[1]);
        let before = self.radio.set("");
        listen_for(time, &mut self.both);
        let after = self.radio.set("");
        let rate = |way: usize| (after[way] - before[way]) as f64 / time.as_secs_f64();
        println!(
            "{what}: {:.0} B/s from the robot, {:.0} back",
            rate(0),
            rate(1)
        );
        let oldest = Ages::new(&self.both, after_ns).print(what);
        let [robot, base] = &self.both;
        println!(
            "{what}: keyframes {} of {}",
            base.keyframe.len(),
            robot.keyframe.len()
        );
        (oldest, rate(0))
    }
}

#[test]
fn over_a_bad_radio_poses_are_young_and_keyframes_come_whole_after_a_break() {
    // 64 kbit/s.
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 190);
    let Some(mut over) = OverRadio::new(&input, "rate=8000 delay=0.1", "") else {
        return;
    };
    listen_until("the first state", &mut over.both, |both| {
        !both[1].state.is_empty()
    });
    // The first map of the window needs some seconds.
    listen_for(Duration::from_secs(3), &mut over.both);
    let (oldest, rate) = over.measure("64 kbit/s", Duration::from_secs(12));
    assert!(oldest < 1.1, "{oldest}");
    assert!(rate < 8000.0 * 1.05, "{rate}");
    over.radio.set("down=1");
    listen_for(Duration::from_secs(4), &mut over.both);
    over.radio.set("down=0 rate=64000 loss=0.05 swap=0.05");
    let before = over.both[1].state.len();
    listen_until("a state after the break", &mut over.both, |both| {
        both[1].state.len() > before
    });
    over.measure("512 kbit/s, loss 5 %", Duration::from_secs(6));
    listen_until("keyframes", &mut over.both, |both| {
        let last = both[0].state.last_key_value();
        last.is_some_and(|(id, _)| *id >= 189) && OverRadio::has_all(both)
    });
    let [robot, base] = &over.both;
    assert_eq!(base.keyframe, robot.keyframe);
    let is_next = |pair: &[u64]| pair[1] == pair[0] + 1;
    assert!(base.order.windows(2).all(is_next), "{:?}", base.order);
    drop(over.ends);
}

/// Waits for something that may take minutes; gives how long it took, s.
fn wait_long(over: &mut OverRadio, most_s: f64, mut holds: impl FnMut(&[Heard; 2]) -> bool) -> f64 {
    let begin = Instant::now();
    loop {
        listen_for(Duration::from_millis(100), &mut over.both);
        let took_s = begin.elapsed().as_secs_f64();
        if holds(&over.both) {
            return took_s;
        }
        assert!(took_s < most_s, "not after {took_s} s");
    }
}

#[test]
#[ignore = "takes half an hour"]
fn breaks_of_ten_minutes_and_a_third_of_all_packets_lost_leave_the_map_whole() {
    let folder = tempfile::tempdir().unwrap();
    let seconds: u32 = 1500;
    let input = log(folder.path(), 5 * seconds);
    let mapper = "mapper = \"base\"";
    // 512 kbit/s.
    let Some(mut over) = OverRadio::new(&input, "rate=64000 delay=0.02", mapper) else {
        return;
    };
    let own = over.ends.folder.path().to_owned();
    let journal = own.join("base.journal");
    let mut base_mapper = over.ends.base.mapper(&journal);
    let has_all = |both: &[Heard; 2]| {
        let keyframes = both[0].keyframe.len() as u64;
        both[1]
            .graph
            .is_some_and(|it| it.on_disk == keyframes && keyframes > 0)
    };
    wait_long(&mut over, 60.0, has_all);
    over.measure("512 kbit/s", Duration::from_secs(30));
    over.radio.set("delay=0.3 loss=0.05 swap=0.05");
    over.measure(
        "delay 300 ms, loss 5 %, other order",
        Duration::from_secs(40),
    );
    over.radio.set("loss=0.3");
    over.measure(
        "delay 300 ms, loss 30 %, other order",
        Duration::from_secs(60),
    );
    over.radio.set("delay=0.05 loss=0 swap=0");
    println!(
        "after it: all after {:.1} s",
        wait_long(&mut over, 600.0, has_all)
    );
    for break_s in [1, 60, 600] {
        over.radio.set("down=1");
        listen_for(Duration::from_secs(break_s) / 2, &mut over.both);
        if break_s > 1 {
            over.ends.base.end(base_mapper, Signal::KILL);
            over.ends.kill_link(Robot);
            let command = over.radio.at(0, &program("link"));
            over.ends.link_by(Robot, command);
            base_mapper = over.ends.base.mapper(&journal);
        }
        listen_for(Duration::from_secs(break_s) / 2, &mut over.both);
        let before = over.radio.set("down=0");
        let after_ns = now_ns(&over.both[1]);
        let lacks = over.both[0].keyframe.len() - over.both[1].keyframe.len();
        let state = over.both[1].state.len();
        let heard_s = wait_long(&mut over, 600.0, |both| both[1].state.len() > state);
        let took_s = wait_long(&mut over, 600.0, has_all) + heard_s;
        let after = over.radio.set("");
        println!(
            "break of {break_s} s: {lacks} keyframes behind, first state after {heard_s:.1} s, \
             all after {took_s:.1} s, {:.0} B/s",
            (after[0] - before[0]) as f64 / took_s
        );
        Ages::new(&over.both, after_ns).print("meanwhile");
    }
    let [robot, base] = &over.both;
    // The bus itself drops what a listener of 20 ms does not take; the link does not.
    assert_eq!(base.keyframe, robot.keyframe);
    wait_long(&mut over, 60.0, |both| {
        both[1].nodes.len() == both[0].keyframe.len()
    });
    check_map(&over.both[1], &own.join("link.journal"));
}

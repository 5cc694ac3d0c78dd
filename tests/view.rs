//! `randt-view` as a process: what viewers get of a running pipeline, also over a link of 200
//! kbit/s with half a second each way, late, and after it was killed; and that nobody else
//! notices.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::stages::program;
use crate::support::viewer::{Got, Viewer, connect, slow_link};
use randt_messages::{OdometryStateTopic, Topic};
use rustix::process::Signal;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::net::{SocketAddr, TcpListener};
use std::process::Command;
use std::time::{Duration, Instant};
use tungstenite::Message;

/// 200 kbit/s, and half a second each way.
const LINK_BYTES_S: f64 = 25_000.0;
const LINK_DELAY: Duration = Duration::from_millis(500);
/// Nothing over such a link takes longer.
const SLOW_MAX: Duration = Duration::from_secs(300);

/// An address that nobody has.
fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap()
}

/// The view of a pipeline.
fn view(pipeline: &mut Pipeline, address: SocketAddr) -> u32 {
    let mut command = Command::new(program("view"));
    pipeline.enter(&mut command);
    command.args(["--listen", &address.to_string()]);
    pipeline.start("view", command)
}

/// What `randt top` prints.
fn top(pipeline: &Pipeline) -> Value {
    let ended = pipeline.randt(&["top", "--once", "--json"]);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// A row of the table.
fn row<'a>(figures: &'a Value, table: &str, name: &str) -> &'a Value {
    let mut rows = figures[table].as_array().unwrap().iter();
    rows.find(|row| row["name"] == name)
        .unwrap_or_else(|| panic!("no {name} in {figures}"))
}

/// Waits as long as a slow link needs.
fn until_slowly(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < SLOW_MAX, "{what}: waited for in vain");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// The value that this share of them is below.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn over_a_slow_link_poses_are_young_and_the_whole_map_comes() {
    let seconds: u64 = match std::env::var_os("RANDT_LONG") {
        Some(_) => 60,
        None => 20,
    };
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 5 * seconds as u32 + 50);
    let address = free_address();
    let mut pipeline = Pipeline::new("vs");
    pipeline.compute(folder.path());
    view(&mut pipeline, address);
    let play = pipeline.play(&input, &["--stay"]);
    let slow = Viewer::open(slow_link(address, LINK_BYTES_S, LINK_DELAY));
    let near = Viewer::open(address);
    // One that asks for everything and takes nothing.
    let mut deaf = connect(address).unwrap();
    for channel in 1..=9 {
        let request = format!(
            r#"{{"op":"subscribe","subscriptions":[{{"id":{channel},"channelId":{channel}}}]}}"#
        );
        deaf.send(Message::text(request)).unwrap();
    }
    until("the first pose", || !slow.on_topic("view/pose").is_empty());
    let begin = Instant::now();
    std::thread::sleep(Duration::from_secs(seconds));
    let figures = top(&pipeline);
    println!("latency {}", figures["latency_ms"]);
    let odometry = row(&figures, "topics", "odometry/state/v1");
    assert!(odometry["rate_hz"].as_f64().unwrap() > 2.5, "{odometry}");
    for name in [
        "odometry/state/v1",
        "radar/points/v1",
        "radar/scan/v1",
        "mapper/grid/v1",
    ] {
        assert_eq!(
            row(&figures, "topics", name)["lost"],
            0,
            "{name}: {figures}"
        );
    }
    let stages = ["filter", "odometry", "mapper", "view"];
    // A busy machine may keep one from its beat of once a second for a moment.
    until("every stage runs", || {
        let figures = top(&pipeline);
        let state = |name| row(&figures, "stages", name)["state"] == "running";
        stages.into_iter().all(state)
    });
    for name in stages {
        let stage = row(&figures, "stages", name);
        assert_eq!(stage["restarts"], 0, "{stage}");
        println!(
            "{name}: {} % of a core, {}",
            stage["cpu_percent"], stage["message"]
        );
    }

    // When each pose came there is what a viewer on the robot itself shows.
    let near_at: BTreeMap<u64, Instant> = near
        .on_topic("view/pose")
        .iter()
        .map(|got| (got.log_time_ns, got.at))
        .collect();
    let poses = slow.on_topic("view/pose");
    let ages: Vec<(f64, f64)> = poses
        .iter()
        .filter_map(|got| {
            let age_s = (got.at - *near_at.get(&got.log_time_ns)?).as_secs_f64();
            Some((got.at.saturating_duration_since(begin).as_secs_f64(), age_s))
        })
        .collect();
    let rate_hz = ages.len() as f64 / seconds as f64;
    let mut sorted: Vec<f64> = ages.iter().map(|(_, age_s)| *age_s).collect();
    sorted.sort_by(f64::total_cmp);
    let half = seconds as f64 / 2.0;
    let mean = |late: bool| {
        let some: Vec<f64> = ages
            .iter()
            .filter(|(at, _)| (*at > half) == late)
            .map(|(_, age)| *age)
            .collect();
        some.iter().sum::<f64>() / some.len() as f64
    };
    let bytes = |viewer: &Viewer, topic: &str| {
        let got = viewer.on_topic(topic);
        (
            got.len(),
            got.iter().map(|got| got.payload.len()).sum::<usize>(),
        )
    };
    for topic in [
        "view/pose",
        "view/transforms",
        "view/points",
        "view/grid",
        "view/path",
        "view/status",
    ] {
        println!(
            "{topic}: slow {:?}, near {:?}",
            bytes(&slow, topic),
            bytes(&near, topic)
        );
    }
    println!(
        "poses {rate_hz:.1} Hz, age median {:.2} p95 {:.2} max {:.2} s, first half {:.2}, second {:.2} s",
        percentile(&sorted, 0.5),
        percentile(&sorted, 0.95),
        sorted.last().unwrap(),
        mean(false),
        mean(true)
    );
    assert!(rate_hz >= 1.0, "{rate_hz}");
    // docs/view.md has 0.9 s; a machine of a test may be busy.
    assert!(percentile(&sorted, 0.95) < 4.5, "{sorted:?}");
    assert!(mean(true) < mean(false) + 1.5, "it grows");
    assert!(slow.on_topic("view/points").len() as u64 > seconds / 3);

    // The drive ends: the map comes whole, and what is old is shown as old.
    pipeline.end(play, Signal::TERM);
    let tile_sizes: Vec<usize> = near.tiles().values().map(Vec::len).collect();
    println!(
        "{} tiles, largest {:?} B, all {} B",
        tile_sizes.len(),
        tile_sizes.iter().max(),
        tile_sizes.iter().sum::<usize>()
    );
    until_slowly("all tiles", || {
        let (slow, near) = (slow.tiles(), near.tiles());
        slow == near && !slow.is_empty()
    });
    println!("all tiles after {:.0} s", begin.elapsed().as_secs_f64());
    until("the age is shown", || {
        let (words, is_red) = slow.status();
        words.contains("odometry silent") && is_red
    });
    println!("{:?}", slow.status());
    // A viewer that took nothing was disconnected, or is now: no stage waits for it.
    until_slowly("the deaf one is gone", || {
        row(&top(&pipeline), "stages", "view")["message"]
            .as_str()
            .unwrap()
            .starts_with("2 viewers")
    });
    assert!(!slow.has_ended() && !near.has_ended());
}

/// Tiles that the mapper has.
fn tiles(pipeline: &Pipeline) -> u64 {
    top(pipeline)["map"]["tiles"].as_u64().unwrap_or(0)
}

#[test]
fn who_comes_late_gets_everything_and_again_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 150);
    let address = free_address();
    let mut pipeline = Pipeline::new("vl");
    pipeline.compute(folder.path());
    let process = view(&mut pipeline, address);
    let early = Viewer::open(address);
    pipeline.play(&input, &["--stay"]);
    until("the first tile", || !early.tiles().is_empty());
    until_slowly("the end of the drive", || {
        early.status().0.contains("odometry silent")
    });
    assert!(early.status().1, "in red");
    let expected = tiles(&pipeline);
    // More than the history of the topic: of quarters "tile ROW COLUMN.QUARTER" whole tiles.
    let shown = early.tiles();
    let shown: BTreeSet<&str> = shown
        .keys()
        .filter_map(|name| name.split('.').next())
        .collect();
    assert!(shown.len() > 8, "{shown:?}");
    let topics: Vec<String> = early.heard.lock().unwrap().topics.clone();
    assert_eq!(topics.len(), 9);
    until("the whole path", || early.on_topic("view/path").len() > 1);

    // A server that knows nothing of the drive: the mapper has sent it the map.
    pipeline.end(process, Signal::KILL);
    until("the connection ends", || early.has_ended());
    view(&mut pipeline, address);
    let late = Viewer::open(address);
    until("all tiles", || late.tiles() == early.tiles());
    until("the path", || {
        late.on_topic("view/path")
            .last()
            .map(|got| got.payload.clone())
            == early
                .on_topic("view/path")
                .last()
                .map(|got| got.payload.clone())
    });
    until("the age", || late.status().0.contains("odometry silent"));

    // A recorder that comes late has the whole map too.
    let mut recorder = Command::new(program("recorder"));
    pipeline.enter(&mut recorder);
    let out = folder.path().join("logs");
    recorder.arg("--out").arg(&out);
    let recorder = pipeline.start("recorder", recorder);
    std::thread::sleep(Duration::from_secs(3));
    pipeline.end(recorder, Signal::TERM);
    let name = crate::support::names(&out).pop().unwrap();
    let mut info = crate::support::randt(&["log", "info", "--json"]);
    info.arg(out.join(name));
    let info: Value = serde_json::from_str(&crate::support::ended(info).stdout).unwrap();
    let recorded = info["topics"]["mapper/grid/v1"]["messages"]
        .as_u64()
        .unwrap();
    assert!(recorded >= expected, "{recorded} of {expected} tiles");
}

#[test]
fn what_is_sent_is_read_by_the_official_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 50);
    let address = free_address();
    let mut pipeline = Pipeline::new("vp");
    pipeline.compute(folder.path());
    view(&mut pipeline, address);
    let viewer = Viewer::open(address);
    pipeline.play(&input, &["--stay"]);
    until("a drive", || viewer.on_topic("view/pose").len() >= 40);
    until("tiles", || {
        !viewer.tiles().is_empty() && !viewer.on_topic("view/path").is_empty()
    });
    let payloads = folder.path().join("payloads");
    std::fs::create_dir(&payloads).unwrap();
    let heard = viewer.heard.lock().unwrap();
    let messages = heard.messages.iter().enumerate();
    for (number, got) in messages.filter(|(_, got)| got.topic.starts_with("view/")) {
        let topic = got.topic.replace('/', "_");
        let name = format!("{}.{topic}.{number}", got.schema);
        std::fs::write(payloads.join(name), &got.payload).unwrap();
    }
    // The state is as a log has it.
    let states = heard
        .messages
        .iter()
        .filter(|got| got.topic == OdometryStateTopic::NAME);
    let state = |got: &Got| randt_log::read_cdr::<OdometryStateTopic>(&got.payload).unwrap();
    let states: Vec<u64> = states.map(|got| state(got).head.id).collect();
    assert!(states.len() > 5 && states.is_sorted(), "{states:?}");
    drop(heard);
    if let Some(mut read) = crate::support::python::script("read_view.py") {
        crate::support::python::run(read.arg(&payloads));
    }
    // A browser that speaks something else is answered with a refusal, and a stranger's words harm
    // nobody.
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    std::io::Write::write_all(&mut stream, b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n").unwrap();
    let mut answer = String::new();
    std::io::Read::read_to_string(&mut stream, &mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 400"), "{answer}");
    for garbage in [
        &[0_u8; 3000][..],
        b"\xff\xff\xff\xff",
        b"GET / HTTP/1.1\r\n\r\n",
    ] {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        let _ = std::io::Write::write_all(&mut stream, garbage);
    }
    let mut rude = connect(address).unwrap();
    for words in [
        "{",
        "[[[[",
        r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":4294967296}]}"#,
    ] {
        rude.send(Message::text(words)).unwrap();
    }
    rude.send(Message::binary(vec![1, 2, 3])).unwrap();
    let _ = rude.send(Message::binary(vec![0; 1 << 20]));
    let count = viewer.on_topic("view/status").len();
    until("it goes on", || {
        viewer.on_topic("view/status").len() > count + 1
    });
}

#[test]
fn up_starts_it() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 25);
    let address = free_address();
    let pipeline = Pipeline::new("vu");
    let mut up = pipeline.command(&["up", "--view"]);
    up.arg("--set").arg(format!("view.listen=\"{address}\""));
    up.arg("--play").arg(&input);
    up.arg("--out").arg(folder.path().join("out"));
    let running = std::thread::spawn(move || crate::support::ended(up));
    let viewer = Viewer::open(address);
    until("a pose", || !viewer.on_topic("view/pose").is_empty());
    let ended = running.join().unwrap();
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(viewer.has_ended());
}

#[test]
fn what_is_no_address_is_refused_at_once() {
    let view = |arguments: &[&str]| {
        let pipeline = Pipeline::new("vb");
        let mut command = Command::new(program("view"));
        pipeline.enter(&mut command);
        command.args(arguments);
        crate::support::ended(command)
    };
    let usage = view(&["--listen", "bad"]);
    assert_eq!(usage.code, Some(2), "{}", usage.stderr);
    let configuration = view(&["--set", "view.listen=\"bad\""]);
    assert_eq!(configuration.code, Some(78), "{}", configuration.stderr);
    for output in [usage.stderr, configuration.stderr] {
        assert!(output.contains("127.0.0.1:8765"), "{output}");
    }
}

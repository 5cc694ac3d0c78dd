//! Who may watch: `randt-view` as a process against what browsers send for pages of others, for
//! names that were made to lead to this machine, and for the viewers' own programs; and a real
//! browser.

use crate::support::browser::{Browser, Pages};
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::run;
use crate::support::stages::{RunFolder, Running};
use crate::support::up::{PATIENT, up};
use crate::support::viewer::connect;
use randt_stage::Domain;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tungstenite::Message;

/// A server that needs no pipeline: its status is "no pose yet".
struct View {
    // It ends before its folder is cleared: fields are dropped in order.
    running: Running,
    folder: RunFolder,
    domain: Domain,
    address: SocketAddr,
}

impl View {
    fn start(prefix: &str, settings: &[&str]) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        let folder = RunFolder::new();
        let domain = folder.domain(prefix);
        let mut command = RunFolder::command(&domain, "view");
        command.args(["--listen", &address.to_string()]);
        for setting in settings {
            command.args(["--set", setting]);
        }
        let running = folder.start("view", command);
        until("the server", || TcpStream::connect(address).is_ok());
        Self {
            running,
            folder,
            domain,
            address,
        }
    }

    /// Its status, as `randt top` shows it.
    fn message(&self) -> String {
        let mut top = crate::support::randt(&["top", "--once", "--json"]);
        top.args(["--prefix", self.domain.prefix(), "--run"])
            .arg(self.folder.run());
        let figures: Value = serde_json::from_str(&crate::support::ended(top).stdout).unwrap();
        let stages = figures["stages"].as_array().unwrap();
        let view = stages.iter().find(|stage| stage["name"] == "view").unwrap();
        view["message"].as_str().unwrap().to_owned()
    }

    /// All that a client gets that sends this and asks for the status, until it is the status.
    fn answer(&self, handshake: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.write_all(handshake.as_bytes()).unwrap();
        // What a page would send next: masked with zeros, as every client's words are.
        let subscribe = br#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":1}]}"#;
        let mut frame = vec![0x81, 0x80 | subscribe.len() as u8, 0, 0, 0, 0];
        frame.extend(subscribe);
        let wait = Some(Duration::from_secs(60));
        stream.set_read_timeout(wait).unwrap();
        let (mut got, mut bytes) = (Vec::new(), [0; 4096]);
        loop {
            match stream.read(&mut bytes) {
                Ok(0) => break,
                Ok(count) => got.extend(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::ConnectionReset => break,
                Err(error) => panic!("{error}"),
            }
            let text = String::from_utf8_lossy(&got);
            if text.contains("no pose yet") {
                break;
            }
            if text.contains("serverInfo") && !frame.is_empty() {
                stream.write_all(&std::mem::take(&mut frame)).unwrap();
            }
        }
        String::from_utf8_lossy(&got).into_owned()
    }
}

/// A handshake as Chromium 156 sends it.
fn chromium(host: &str, origin: &str) -> String {
    format!(
        "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nPragma: no-cache\r\n\
         Cache-Control: no-cache\r\nUser-Agent: Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 \
         (KHTML, like Gecko) HeadlessChrome/156.0.0.0 Safari/537.36\r\nUpgrade: websocket\r\n\
         Origin: {origin}\r\nSec-WebSocket-Version: 13\r\nAccept-Encoding: gzip, deflate, br, zstd\r\n\
         Accept-Language: en-US,en;q=0.9\r\nSec-WebSocket-Key: 4z8CwEg+bTIKkjE5KLFsIw==\r\n\
         Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\
         Sec-WebSocket-Protocol: foxglove.websocket.v1, foxglove.sdk.v1\r\n\r\n"
    )
}

/// The same in the order in which Firefox sends it.
fn firefox(host: &str, origin: &str) -> String {
    format!(
        "GET / HTTP/1.1\r\nHost: {host}\r\nUser-Agent: Mozilla/5.0 (X11; Linux x86_64; rv:140.0) \
         Gecko/20100101 Firefox/140.0\r\nAccept: */*\r\nAccept-Language: en-US,en;q=0.5\r\n\
         Accept-Encoding: gzip, deflate, br, zstd\r\nSec-WebSocket-Version: 13\r\nOrigin: {origin}\r\n\
         Sec-WebSocket-Protocol: foxglove.websocket.v1, foxglove.sdk.v1\r\n\
         Sec-WebSocket-Extensions: permessage-deflate\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nConnection: keep-alive, Upgrade\r\n\
         Sec-Fetch-Dest: empty\r\nSec-Fetch-Mode: websocket\r\nSec-Fetch-Site: cross-site\r\n\
         Pragma: no-cache\r\nCache-Control: no-cache\r\nUpgrade: websocket\r\n\r\n"
    )
}

#[test]
fn pages_of_others_get_nothing_and_viewers_what_they_had() {
    let settings = [
        "view.origins=https://viewer.example:8443",
        "view.host_names=gate.example",
    ];
    let view = View::start("va", &settings);
    let port = view.address.port();
    let here = format!("localhost:{port}");
    for (host, origin) in [
        // A page of anybody; one in a sandboxed frame or a data: URL; code in Foxglove's frame.
        (&here, "http://evil.example:39443"),
        (&here, "null"),
        (&here, "https://embed.foxglove.dev"),
        (&here, "https://viewer.example"),
        (&format!("127.0.0.1:{port}"), "https://evil.example"),
        (&format!("[::1]:{port}"), "https://evil.example"),
        // DNS rebinding: the page's own name leads here, to the port that it came from too.
        (&format!("evil.example:{port}"), "http://evil.example:39443"),
        (
            &format!("evil.example:{port}"),
            &format!("http://evil.example:{port}"),
        ),
        (&format!("evil.example:{port}"), "null"),
    ] {
        for handshake in [chromium(host, origin), firefox(host, origin)] {
            let got = view.answer(&handshake);
            assert!(got.starts_with("HTTP/1.1 403 "), "{host} {origin}: {got}");
            assert!(!got.contains("pose") && !got.contains("randt"), "{got}");
        }
    }
    for (host, origin) in [
        (&here, "file://"),
        (&here, "https://app.foxglove.dev"),
        (&here, "https://lichtblick-suite.github.io"),
        (&here, "http://localhost:8080"),
        (&format!("127.0.0.1:{port}"), "http://localhost:8080"),
        (
            &format!("gate.example:{port}"),
            "https://viewer.example:8443",
        ),
    ] {
        for handshake in [chromium(host, origin), firefox(host, origin)] {
            let got = view.answer(&handshake);
            assert!(got.starts_with("HTTP/1.1 101 "), "{host} {origin}: {got}");
            assert!(got.contains("no pose yet"), "{host} {origin}: {got}");
        }
    }
    // No browser: without an origin.
    let own_name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let program = chromium(&format!("{}.local:{port}", own_name.trim()), "");
    let got = view.answer(&program.replace("Origin: \r\n", ""));
    assert!(got.contains("no pose yet"), "{got}");
    let refused = "refused: 12 by origin, 6 by host";
    until(refused, || view.message().contains(refused));
    let output = view.running.stderr();
    for kind in ["a page of origin", "none of this machine's names"] {
        assert_eq!(output.matches(kind).count(), 1, "a line a minute: {output}");
    }
}

#[test]
fn an_origin_that_every_page_has_is_no_configuration() {
    for (setting, expected) in [
        ("view.origins=null", "SCHEME://HOST"),
        ("view.origins=*", "SCHEME://HOST"),
        ("view.host_names=127.0.0.1", "host names"),
        ("view.clients_max_per_address=0", "from 1 to 64"),
    ] {
        let folder = RunFolder::new();
        let mut command = RunFolder::command(&folder.domain("vk"), "view");
        command.args(["--set", setting]);
        let ended = crate::support::ended(command);
        assert_eq!(ended.code, Some(78), "{setting}: {}", ended.stderr);
        let key = setting.split('=').next().unwrap();
        assert!(
            ended.stderr.contains(key) && ended.stderr.contains(expected),
            "{}",
            ended.stderr
        );
    }
}

/// Clients of all wrong kinds, some hundred a second, until the end; gives how many there were.
fn crowd(address: SocketAddr, is_over: &AtomicBool) -> u64 {
    let mut silent = VecDeque::new();
    let mut count = 0;
    let handshakes = [
        chromium("localhost", "https://evil.example"),
        firefox("evil.example", "http://evil.example"),
        "GET / HTTP/1.1\r\nHost: x\r\n\r\n".to_owned(),
        "\u{16}\u{3}\u{1}".repeat(900),
    ];
    while !is_over.load(Ordering::Relaxed) {
        for words in &handshakes {
            // Before the server is there, and after.
            let Ok(mut stream) = TcpStream::connect(address) else {
                continue;
            };
            count += 1;
            // The server may have closed already.
            let _ = stream.write_all(words.as_bytes());
            silent.extend(TcpStream::connect(address).ok());
            if silent.len() > 40 {
                silent.pop_front();
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    count
}

/// A viewer that asks for everything and takes nothing; another one when it was let go.
fn deaf(address: SocketAddr, is_over: &AtomicBool) {
    while !is_over.load(Ordering::Relaxed) {
        let Ok(mut viewer) = connect(address) else {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        };
        let channels: Vec<Value> = (1..=9)
            .map(|n| json!({ "id": n, "channelId": n }))
            .collect();
        let request = json!({ "op": "subscribe", "subscriptions": channels }).to_string();
        // Where it was let go at once.
        let mut is_open = viewer.send(Message::text(request)).is_ok();
        while is_open && !is_over.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(200));
            is_open = viewer.send(Message::Pong(Vec::new().into())).is_ok();
        }
    }
}

#[test]
fn a_crowd_of_clients_changes_no_bit_of_odometry() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 40);
    let at = |name: &str| folder.path().join(name);
    let alone = run(&input, &at("alone"), &PATIENT);
    assert_eq!(alone.code, Some(0), "{}", alone.stderr);
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let own = Pipeline::new("vc");
    let mut command = up(own.domain(), &input, &at("crowded"));
    command.args(["--view", "--set", &format!("view.listen={address}")]);
    let is_over = AtomicBool::new(false);
    let crowded = std::thread::scope(|scope| {
        let crowd = scope.spawn(|| crowd(address, &is_over));
        for _ in 0..3 {
            scope.spawn(|| deaf(address, &is_over));
        }
        let ended = catch_unwind(AssertUnwindSafe(|| crate::support::ended(command)));
        is_over.store(true, Ordering::Relaxed);
        let count = crowd.join().unwrap();
        println!("{count} clients");
        let ended = ended.unwrap_or_else(|panic| resume_unwind(panic));
        assert!(count > 0, "{}", ended.stderr);
        ended
    });
    assert_eq!(crowded.code, Some(0), "{}", crowded.stderr);
    for name in ["odometry.tum", "trajectory.tum", "map.pgm"] {
        let [found, expected] =
            ["crowded", "alone"].map(|out| std::fs::read(at(out).join(name)).unwrap());
        assert!(found == expected, "{name} differs");
    }
}

#[test]
#[ignore = "needs a browser: apt-get install chromium; cargo test --test programs a_real_browser -- --ignored"]
fn a_real_browser_shows_its_own_pages_only() {
    let view = View::start("vr", &[]);
    let pages = Pages::serve();
    let port = view.address.port();
    let browser = Browser::new();
    for (page_host, target, expected) in [
        // The page of somebody else, and the same by a name that was rebound. Each also tries from
        // a worker and a sandboxed frame.
        ("evil.example", "localhost", "nothing nothing nothing"),
        ("evil.example", "127.0.0.1", "nothing nothing nothing"),
        ("evil.example", "evil.example", "nothing nothing nothing"),
        // A viewer that the operator's own machine serves; every frame could have "null".
        ("localhost", "localhost", "status status nothing"),
        ("127.0.0.1", "localhost", "status status nothing"),
    ] {
        let found = browser.visit(&pages, page_host, &format!("ws://{target}:{port}"));
        assert_eq!(found, expected, "http://{page_host} to ws://{target}");
    }
    // Lichtblick's desktop program has files for pages, which Electron gives this privilege.
    let target = format!("ws://localhost:{port}");
    let found = browser.visit_file(&pages, &target, &["--allow-file-access-from-files"]);
    assert_eq!(found, "status status nothing");
    // A file that was downloaded has it not.
    let found = browser.visit_file(&pages, &target, &[]);
    assert_eq!(found, "nothing nothing nothing");
    let output = view.message();
    println!("{output}\n{}", view.running.stderr());
    assert!(output.contains("12 by origin, 3 by host"), "{output}");
}

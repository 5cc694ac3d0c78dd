//! Clients that are no viewers: they get nothing, and take nothing from the viewers.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test reports failures by panicking"
)]

use randt_config::{HostNames, WebOrigins};
use randt_view::{AccessPolicy, Board, Server, ViewerLimits};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;

const LIMITS: ViewerLimits = ViewerLimits {
    total: 4,
    per_address: 2,
};

/// A server in a thread of its own, as long as `visit` lasts; gives its lines for the journal.
fn while_served(visit: impl FnOnce(SocketAddr)) -> Vec<String> {
    while_served_at(1.0, visit)
}

/// The same by a clock that runs that many times faster.
fn while_served_at(speed: f64, visit: impl FnOnce(SocketAddr)) -> Vec<String> {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let is_over = AtomicBool::new(false);
    let mut lines = Vec::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let policy = AccessPolicy::new(&WebOrigins::default(), &HostNames::default());
            let mut server = Server::new(&address.to_string(), policy, LIMITS, 1);
            let (board, begin) = (Board::default(), Instant::now());
            while !is_over.load(Ordering::SeqCst) {
                let now_ns = (begin.elapsed().as_secs_f64() * 1e9 * speed) as i64;
                server.turn(&board, now_ns, &mut |line| lines.push(line.to_owned()));
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        // A test that fails ends the server all the same.
        let result = catch_unwind(AssertUnwindSafe(|| visit(address)));
        is_over.store(true, Ordering::SeqCst);
        if let Err(panic) = result {
            resume_unwind(panic);
        }
    });
    lines
}

fn connect(address: SocketAddr) -> TcpStream {
    let begin = Instant::now();
    loop {
        match TcpStream::connect(address) {
            Ok(stream) => return stream,
            Err(error) => assert!(begin.elapsed() < Duration::from_secs(10), "{error}"),
        }
    }
}

/// Reads until the server has closed; gives what came.
fn to_the_end(mut stream: TcpStream) -> Vec<u8> {
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let mut got = Vec::new();
    match stream.read_to_end(&mut got) {
        Err(error) if error.kind() != ErrorKind::ConnectionReset => panic!("{error}"),
        _ => got,
    }
}

/// The first message to a viewer.
fn greeting(address: SocketAddr) -> String {
    let mut request = format!("ws://{address}").into_client_request().unwrap();
    let protocol = HeaderValue::from_static("foxglove.sdk.v1");
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let (mut socket, _) = tungstenite::client(request, connect(address)).unwrap();
    match socket.read().unwrap() {
        Message::Text(text) => text.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_no_handshake_is_shown_the_door() {
    while_served(|address| {
        for words in [
            &b"SSH-2.0-OpenSSH_9.2\r\n\r\n"[..],
            &[0xff; 300],
            b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        ] {
            let mut client = connect(address);
            client.write_all(words).unwrap();
            let got = String::from_utf8_lossy(&to_the_end(client)).into_owned();
            assert!(!got.contains("serverInfo"), "{got}");
        }
        assert!(greeting(address).contains("serverInfo"));
    });
}

#[test]
fn a_silent_client_delays_no_other() {
    let lines = while_served(|address| {
        let silent: Vec<TcpStream> = (0..LIMITS.total).map(|_| connect(address)).collect();
        assert!(greeting(address).contains("serverInfo"));
        drop(silent);
    });
    assert!(
        lines.iter().any(|line| line.ends_with("watches")),
        "{lines:?}"
    );
}

/// The rest of a good handshake.
const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
                       Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n";

/// Sends something and reads what comes in a moment, or until the end.
fn answer(address: SocketAddr, request: &[u8]) -> String {
    let mut stream = connect(address);
    stream.write_all(request).unwrap();
    let wait = Some(Duration::from_secs(10));
    stream.set_read_timeout(wait).unwrap();
    let mut got = Vec::new();
    let mut bytes = [0; 4096];
    // A viewer's connection stays open: its first message is enough.
    while !String::from_utf8_lossy(&got).contains("serverInfo") {
        match stream.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => got.extend(&bytes[..count]),
            Err(error) if error.kind() == ErrorKind::ConnectionReset => break,
            Err(error) => panic!("{error}: {}", String::from_utf8_lossy(&got)),
        }
    }
    String::from_utf8_lossy(&got).into_owned()
}

#[test]
fn a_request_that_can_be_read_in_two_ways_is_refused() {
    let good = "Host: localhost:1";
    while_served(|address| {
        let status = |head: &str| {
            let got = answer(address, format!("{head}\r\n{UPGRADE}").as_bytes());
            let is_viewer = got.contains("serverInfo");
            assert_eq!(is_viewer, got.starts_with("HTTP/1.1 101"), "{head}: {got}");
            // "closed": it was not even understood.
            got.get(9..12).unwrap_or("closed").to_owned()
        };
        for (head, expected) in [
            (format!("GET / HTTP/1.1\r\n{good}"), "101"),
            (
                "GET /?x HTTP/1.1\r\nhOST:LOCALHOST:99  \r\norigin:\tfile://".to_owned(),
                "101",
            ),
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nORIGIN: https://evil.example"),
                "403",
            ),
            (format!("GET / HTTP/1.1\r\n{good}\r\nOrigin:"), "403"),
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nOrigin: file://\r\norigin: null"),
                "400",
            ),
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nhost: evil.example"),
                "400",
            ),
            ("GET / HTTP/1.1\r\nHost: evil.example".to_owned(), "403"),
            ("GET / HTTP/1.1\r\nHost: localhost.".to_owned(), "403"),
            ("GET / HTTP/1.1\r\nHost: a@localhost".to_owned(), "403"),
            ("GET / HTTP/1.1\r\nHost:".to_owned(), "403"),
            ("GET / HTTP/1.1".to_owned(), "400"),
            (
                "GET / HTTP/1.1\r\nX-Forwarded-Host: localhost".to_owned(),
                "400",
            ),
            (format!("GET http://localhost:1/ HTTP/1.1\r\n{good}"), "400"),
            (format!("GET * HTTP/1.1\r\n{good}"), "400"),
            (format!("GET localhost:1 HTTP/1.1\r\n{good}"), "400"),
            // A line that goes on, a blank before the colon, another method or version.
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nOrigin: file://\r\n evil"),
                "closed",
            ),
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nOrigin : file://"),
                "closed",
            ),
            (format!("POST / HTTP/1.1\r\n{good}"), "closed"),
            (format!("GET / HTTP/1.0\r\n{good}"), "closed"),
            (
                format!("GET / HTTP/1.1\r\n{good}\r\nX: {}", "x".repeat(70_000)),
                "closed",
            ),
            (
                format!("GET / HTTP/1.1\r\n{good}{}", "\r\nX: x".repeat(500)),
                "closed",
            ),
        ] {
            let found = status(&head);
            assert_eq!(
                found,
                expected,
                "{}",
                head.chars().take(200).collect::<String>()
            );
        }
        // The server's first message does not go to a client that sent more than a handshake,
        // unread.
        let twice = format!("GET / HTTP/1.1\r\n{good}\r\n{UPGRADE}GET / HTTP/1.1\r\n");
        assert!(!answer(address, twice.as_bytes()).contains("serverInfo"));
    });
}

#[test]
fn a_refused_client_gets_the_reason_and_no_more() {
    let lines = while_served(|address| {
        let request = format!("GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: null\r\n{UPGRADE}");
        let got = answer(address, request.as_bytes());
        let (head, body) = got.split_once("\r\n\r\n").unwrap();
        assert!(head.starts_with("HTTP/1.1 403 Forbidden\r\n"), "{head}");
        assert!(!head.to_ascii_lowercase().contains("websocket"), "{head}");
        assert!(body.contains("view.origins") && body.len() < 200, "{body}");
    });
    let line = lines.iter().find(|line| line.contains("\"null\""));
    assert!(
        line.is_some_and(|line| line.contains("turned away")),
        "{lines:?}"
    );
}

#[test]
fn who_sends_his_handshake_byte_by_byte_is_gone_in_time() {
    let lines = while_served_at(100.0, |address| {
        let begin = Instant::now();
        let mut slow = connect(address);
        let request = format!(
            "GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n",
            "x".repeat(4000)
        );
        // Until the server has closed: ten seconds of its own.
        for byte in request.bytes() {
            if slow.write_all(&[byte]).is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        println!("closed after {:?}", begin.elapsed());
    });
    assert!(
        lines.iter().any(|line| line.contains("not done in time")),
        "{lines:?}"
    );
}

#[test]
fn a_crowd_locks_no_viewer_out_and_the_journal_stays_short() {
    // By a slow clock: all of it is within a minute.
    let lines = while_served_at(0.001, |address| {
        // More than may wait, all from one address, which stay.
        let crowd: Vec<TcpStream> = (0..80).map(|_| connect(address)).collect();
        assert!(greeting(address).contains("serverInfo"));
        for _ in 0..60 {
            let request = format!("GET / HTTP/1.1\r\nHost: evil.example\r\n{UPGRADE}");
            let got = answer(address, request.as_bytes());
            assert!(got.starts_with("HTTP/1.1 403"), "{got}");
            drop(connect(address));
        }
        assert!(greeting(address).contains("serverInfo"));
        drop(crowd);
    });
    let about = |words: &str| lines.iter().filter(|line| line.contains(words)).count();
    assert_eq!(
        (about("make room"), about("evil.example")),
        (1, 1),
        "{lines:?}"
    );
    assert!(lines.len() <= 10, "{lines:?}");
}

#[test]
fn one_viewer_too_many_gets_the_reason() {
    while_served(|address| {
        let mut viewers = Vec::new();
        for _ in 0..=LIMITS.total {
            let request = format!("ws://{address}").into_client_request();
            let mut request = request.unwrap();
            let protocol = HeaderValue::from_static("foxglove.websocket.v1");
            let headers = request.headers_mut();
            headers.insert("Sec-WebSocket-Protocol", protocol);
            let (socket, _) = tungstenite::client(request, connect(address)).unwrap();
            viewers.push(socket);
        }
        let mut last = viewers.pop().unwrap();
        match last.read().unwrap() {
            Message::Close(Some(frame)) => {
                assert!(frame.reason.contains("view.clients_max"), "{frame:?}");
            }
            other => panic!("{other:?}"),
        }
        for viewer in &mut viewers {
            assert!(matches!(viewer.read(), Ok(Message::Text(_))));
        }
    });
}

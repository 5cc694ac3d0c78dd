//! Who connects without being a viewer: he gets nothing, and takes nothing away from those who are.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use randt_view::{Board, Server};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;

/// Viewers at once.
const CLIENTS_MAX: usize = 4;

/// A server in a thread of its own, as long as `visit` lasts; gives what it said.
fn while_served(visit: impl FnOnce(SocketAddr)) -> Vec<String> {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let is_over = AtomicBool::new(false);
    let mut said = Vec::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut server = Server::new(&address.to_string(), CLIENTS_MAX, 1);
            let (board, begin) = (Board::default(), Instant::now());
            while !is_over.load(Ordering::SeqCst) {
                let now_ns = begin.elapsed().as_nanos() as i64;
                server.turn(&board, now_ns, &mut |line| said.push(line.to_owned()));
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        visit(address);
        is_over.store(true, Ordering::SeqCst);
    });
    said
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

/// The first word to a viewer.
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
            let mut stranger = connect(address);
            stranger.write_all(words).unwrap();
            let got = String::from_utf8_lossy(&to_the_end(stranger)).into_owned();
            assert!(!got.contains("serverInfo"), "{got}");
        }
        assert!(greeting(address).contains("serverInfo"));
    });
}

#[test]
fn who_says_nothing_holds_nobody_up() {
    let said = while_served(|address| {
        let silent: Vec<TcpStream> = (0..CLIENTS_MAX - 1).map(|_| connect(address)).collect();
        assert!(greeting(address).contains("serverInfo"));
        drop(silent);
    });
    assert!(
        said.iter().any(|line| line.ends_with("watches")),
        "{said:?}"
    );
}

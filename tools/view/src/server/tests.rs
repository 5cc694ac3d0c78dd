//! The listening socket, and what happens with a crowd of clients.

use super::*;
use randt_config::{HostNames, WebOrigins};
use std::net::TcpStream;

#[test]
fn what_is_no_address_is_refused() {
    for text in ["bad", "", "127.0.0.1", "127.0.0.1:99999", ":x"] {
        assert!(check_address(text).is_err(), "{text:?}");
    }
    for text in ["127.0.0.1:0", "[::1]:8765", "0.0.0.0:1"] {
        assert!(check_address(text).is_ok(), "{text:?}");
    }
}

#[test]
fn an_address_that_is_taken_is_tried_again() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let policy = AccessPolicy::new(&WebOrigins::default(), &HostNames::default());
    let limits = ViewerLimits {
        total: 2,
        per_address: 2,
    };
    let mut server = Server::new(&address, policy, limits, 1);
    let board = Board::default();
    let mut lines = Vec::new();
    let mut turn = |server: &mut Server, now_ns| {
        server.turn(&board, now_ns, &mut |line| lines.push(line.to_owned()));
    };
    turn(&mut server, 0);
    assert!(server.fault().contains(&address), "{}", server.fault());
    drop(taken);
    turn(&mut server, AGAIN_NS / 2);
    assert!(!server.fault().is_empty());
    turn(&mut server, AGAIN_NS);
    assert_eq!((server.fault(), server.descriptors().count()), ("", 1));
    // A client that sends nothing is no viewer, and only a limited number may be unfinished.
    let crowd: Vec<_> = (0..HANDSHAKES_MAX + 2)
        .map(|_| TcpStream::connect(&address).unwrap())
        .collect();
    turn(&mut server, AGAIN_NS);
    assert_eq!(server.descriptors().count(), 1 + HANDSHAKES_MAX);
    assert_eq!(server.status_remark(0), "no viewer; refused: 2 no room");
    drop(crowd);
    turn(&mut server, AGAIN_NS);
    assert_eq!(server.descriptors().count(), 1);
    assert_eq!(lines.len(), 3, "one line of each kind: {lines:?}");
    assert!(lines[0].starts_with("ws://127.0.0.1:"));
}

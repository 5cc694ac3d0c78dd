//! Who watches: the listening socket, and all viewers' connections.

use crate::Board;
use crate::connection::Connection;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

/// An address that cannot be had is tried again so often, ns.
const AGAIN_NS: i64 = 1_000_000_000;
/// With viewers something is due so often.
const PAUSE: Duration = Duration::from_millis(100);
/// A socket that was full is tried again so soon.
const PAUSE_FULL: Duration = Duration::from_millis(20);
/// Without viewers nothing is.
const PAUSE_ALONE: Duration = Duration::from_secs(1);
/// Frames that a viewer misses until it is told of, a second.
const BEHIND: u64 = 1;

/// All viewers.
pub struct Server {
    listen: String,
    clients_max: usize,
    session: String,
    listener: Option<TcpListener>,
    again_ns: i64,
    trouble: String,
    connections: Vec<Connection>,
}

/// Refuses what can never be an address with a port; a name that nobody knows yet may be known later.
pub fn check_address(text: &str) -> Result<String, &'static str> {
    match text.to_socket_addrs() {
        Err(cause) if cause.kind() == ErrorKind::InvalidInput => {
            Err("ADDRESS:PORT, such as 127.0.0.1:8765")
        }
        _ => Ok(text.to_owned()),
    }
}

impl Server {
    /// One that will listen at an address. `session` is another one for every process.
    pub fn new(listen: &str, clients_max: usize, session: u64) -> Self {
        Self {
            listen: listen.to_owned(),
            clients_max,
            session: session.to_string(),
            listener: None,
            again_ns: i64::MIN,
            trouble: String::new(),
            connections: Vec::new(),
        }
    }

    /// Lets viewers in, hears them, sends them what may go. `say` gets a line for the journal.
    pub fn turn(&mut self, board: &Board, now_ns: i64, say: &mut dyn FnMut(&str)) {
        self.listen(now_ns, say);
        self.let_in(now_ns, say);
        self.connections.retain_mut(|connection| {
            let turn = connection.turn(board, now_ns);
            if let Err(why) = &turn {
                say(&format!("{} is gone: {why}", connection.address));
            }
            turn.is_ok()
        });
    }

    fn listen(&mut self, now_ns: i64, say: &mut dyn FnMut(&str)) {
        if self.listener.is_some() || now_ns < self.again_ns {
            return;
        }
        self.again_ns = now_ns.saturating_add(AGAIN_NS);
        let made = TcpListener::bind(&self.listen).and_then(|listener| {
            listener.set_nonblocking(true)?;
            Ok((listener.local_addr()?, listener))
        });
        match made {
            Ok((address, listener)) => {
                say(&format!("ws://{address}"));
                self.trouble.clear();
                self.listener = Some(listener);
            }
            Err(cause) => self.trouble = format!("nobody can watch: {}: {cause}", self.listen),
        }
    }

    fn let_in(&mut self, now_ns: i64, say: &mut dyn FnMut(&str)) {
        while let Some(listener) = &self.listener {
            match listener.accept() {
                Ok((stream, address)) => self.welcome(stream, address, now_ns, say),
                Err(cause) if cause.kind() == ErrorKind::WouldBlock => return,
                Err(cause) => {
                    say(&format!("a viewer could not come in: {cause}"));
                    return;
                }
            }
        }
    }

    fn welcome(
        &mut self,
        stream: TcpStream,
        address: SocketAddr,
        now_ns: i64,
        say: &mut dyn FnMut(&str),
    ) {
        if self.connections.len() >= self.clients_max {
            say(&format!(
                "{address} is turned away: {} watch",
                self.connections.len()
            ));
            return;
        }
        match Connection::new(stream, address, &self.session, now_ns) {
            Ok(connection) => {
                say(&format!("{address} watches"));
                self.connections.push(connection);
            }
            Err(cause) => say(&format!("{address}: {cause}")),
        }
    }

    /// What is wrong; empty where nothing is.
    pub fn trouble(&self) -> &str {
        &self.trouble
    }

    /// Who watches and how well.
    pub fn remark(&self, now_ns: i64) -> String {
        let mut words = match self.connections.len() {
            0 => "nobody watches".to_owned(),
            1 => "1 viewer".to_owned(),
            count => format!("{count} viewers"),
        };
        let slowest = self.connections.iter().max_by_key(|c| c.client.dropped);
        if let Some(slowest) = slowest.filter(|slowest| slowest.client.dropped >= BEHIND) {
            words.push_str(&format!(
                "; {}: {} dropped frames, link {:.1} s",
                slowest.address,
                slowest.client.dropped,
                slowest.flow.round_trip_s(now_ns)
            ));
        }
        words
    }

    /// What to watch for something to read.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let doors = self.listener.iter().map(AsFd::as_fd);
        doors.chain(self.connections.iter().map(Connection::descriptor))
    }

    /// How long to sleep at most.
    pub fn pause(&self) -> Duration {
        match self.connections.as_slice() {
            [] => PAUSE_ALONE,
            some if some.iter().any(|connection| connection.is_full) => PAUSE_FULL,
            _ => PAUSE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut server = Server::new(&address, 2, 1);
        let board = Board::default();
        let mut said = Vec::new();
        let mut turn = |server: &mut Server, now_ns| {
            server.turn(&board, now_ns, &mut |line| said.push(line.to_owned()));
        };
        turn(&mut server, 0);
        assert!(server.trouble().contains(&address), "{}", server.trouble());
        drop(taken);
        turn(&mut server, AGAIN_NS / 2);
        assert!(!server.trouble().is_empty());
        turn(&mut server, AGAIN_NS);
        assert_eq!((server.trouble(), server.descriptors().count()), ("", 1));
        // One more than it has room for.
        let viewers: Vec<_> = (0..3)
            .map(|_| TcpStream::connect(&address).unwrap())
            .collect();
        turn(&mut server, AGAIN_NS);
        assert_eq!(server.remark(0), "2 viewers");
        drop(viewers);
        turn(&mut server, AGAIN_NS);
        assert_eq!(server.remark(0), "nobody watches");
        assert!(said[0].starts_with("ws://127.0.0.1:"));
    }
}

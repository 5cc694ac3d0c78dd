//! The connection to a Navtech: made, kept, lost and made again. Does I/O.

use super::decoder::NavtechDecoder;
use super::frame::{command, kind};
use crate::poller::open_socket;
use crate::{BeamDecoder, BeamSink, BeamSource, Poller};
use randt_device::{Backoff, Count, Link};
use rustix::io::Errno;
use rustix::net::{self, SendFlags, SocketType, sockopt};
use std::net::SocketAddr;
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// A connection that takes longer is given up, ns: a radar is one switch away.
const CONNECT_NS: i64 = 3_000_000_000;
/// Between signs of life to the radar, ns (Navtech's Colossus).
const KEEP_ALIVE_NS: i64 = 5_000_000_000;
/// A radar that is silent for this many times `radar.silence_s` is connected anew: a cut cable
/// gives no error.
const SILENCES: i64 = 3;
/// Bytes that are read at once: ten beams.
const READ_BYTES: usize = 64 << 10;
/// Reads until others have their turn: a sweep and a half.
const READS_MAX: usize = 32;

/// How far the connection is.
#[derive(Debug)]
enum Connection {
    None,
    Connecting {
        socket: OwnedFd,
        since_ns: i64,
    },
    Open {
        socket: OwnedFd,
        since_ns: i64,
        keep_alive_ns: i64,
    },
}

/// A Navtech over TCP.
pub struct NavtechClient {
    address: SocketAddr,
    silence_ns: i64,
    poller: Arc<Poller>,
    decoder: NavtechDecoder,
    connection: Connection,
    backoff: Backoff,
    link: Link,
    /// Last beam of this connection, ns.
    beam_ns: Option<i64>,
    /// Since when there is no beam, for which the radar was asked once more, ns.
    asked_ns: i64,
    answered: Answered,
    connects: u64,
    received: Vec<u8>,
}

/// How many of the decoder's configurations and doubts were answered.
#[derive(Debug, Default)]
struct Answered {
    configurations: u64,
    doubts: u64,
}

impl NavtechClient {
    /// A client of a radar that need not be there yet.
    pub fn new(
        address: SocketAddr,
        silence_ns: i64,
        decoder: NavtechDecoder,
        poller: Arc<Poller>,
    ) -> Self {
        Self {
            address,
            silence_ns,
            poller,
            decoder,
            connection: Connection::None,
            backoff: Backoff::default(),
            link: Link::Starting,
            beam_ns: None,
            asked_ns: 0,
            answered: Answered::default(),
            connects: 0,
            received: vec![0; READ_BYTES],
        }
    }

    fn connect(&mut self, now_ns: i64) -> Result<(), Errno> {
        let socket = open_socket(&self.address, SocketType::STREAM)?;
        sockopt::set_tcp_nodelay(&socket, true)?;
        match net::connect(&socket, &self.address) {
            Ok(()) | Err(Errno::INPROGRESS) => {}
            Err(errno) => return Err(errno),
        }
        self.poller
            .writable(&socket)
            .map_err(|error| Errno::from_io_error(&error).unwrap_or(Errno::IO))?;
        self.connection = Connection::Connecting {
            socket,
            since_ns: now_ns,
        };
        Ok(())
    }

    /// The connection is gone, for this reason: tries again later.
    fn lost(&mut self, why: String, now_ns: i64, sink: &mut dyn BeamSink) {
        self.connection = Connection::None;
        self.link = Link::Down(why);
        self.backoff.failed(now_ns);
        self.beam_ns = None;
        self.decoder.restart();
        sink.restarted();
    }

    fn no_answer(&self, errno: Errno) -> String {
        let why = std::io::Error::from(errno).kind();
        format!("no answer from {} ({why}); trying again", self.address)
    }

    /// A connection under way: whether it is made, refused or still open.
    fn established(socket: &OwnedFd, waited_ns: i64) -> Result<bool, Errno> {
        sockopt::socket_error(socket)??;
        match net::getpeername(socket) {
            Ok(_) => Ok(true),
            Err(Errno::NOTCONN) if waited_ns < CONNECT_NS => Ok(false),
            Err(Errno::NOTCONN) => Err(Errno::TIMEDOUT),
            Err(errno) => Err(errno),
        }
    }

    fn send(socket: &OwnedFd, version: u8, kind: u8) -> Result<(), String> {
        let mut bytes = Vec::new();
        command(version, kind, &mut bytes);
        match net::send(socket, &bytes, SendFlags::NOSIGNAL) {
            Ok(sent) if sent == bytes.len() => Ok(()),
            Ok(_) => Err("the radar takes nothing more; connecting anew".to_owned()),
            Err(errno) => {
                let why = std::io::Error::from(errno).kind();
                Err(format!("the connection is gone ({why}); connecting anew"))
            }
        }
    }

    fn opened(&mut self, now_ns: i64) {
        let connecting = std::mem::replace(&mut self.connection, Connection::None);
        if let Connection::Connecting { socket, .. } = connecting {
            self.connects += 1;
            self.asked_ns = now_ns;
            self.connection = Connection::Open {
                socket,
                since_ns: now_ns,
                keep_alive_ns: now_ns + KEEP_ALIVE_NS,
            };
        }
    }

    /// Takes what has come and sends what is due; gives the reason for which the connection must
    /// be given up.
    fn serve(&mut self, now_ns: i64, sink: &mut dyn BeamSink) -> Result<(), String> {
        let Connection::Open {
            socket,
            since_ns,
            keep_alive_ns,
        } = &mut self.connection
        else {
            return Ok(());
        };
        for _ in 0..READS_MAX {
            match rustix::io::read(&*socket, &mut self.received) {
                Ok(0) => return Err("the radar has closed the connection; trying again".to_owned()),
                Ok(count) => {
                    let beam_ns = &mut self.beam_ns;
                    let bytes = self.received.get(..count).unwrap_or_default();
                    self.decoder.decode(bytes, now_ns, &mut |beam| {
                        *beam_ns = Some(now_ns);
                        sink.beam(beam);
                    });
                }
                Err(Errno::AGAIN) => break,
                Err(Errno::INTR) => {}
                Err(errno) => {
                    let why = std::io::Error::from(errno).kind();
                    return Err(format!("the connection is gone ({why}); trying again"));
                }
            }
        }
        let version = self.decoder.version();
        if self.answered.configurations != self.decoder.configurations() {
            self.answered.configurations = self.decoder.configurations();
            self.asked_ns = now_ns;
            Self::send(socket, version, kind::START_FFT)?;
        }
        if self.answered.doubts != self.decoder.doubts() {
            self.answered.doubts = self.decoder.doubts();
            Self::send(socket, version, kind::CONFIGURATION_REQUEST)?;
        }
        if now_ns >= *keep_alive_ns {
            *keep_alive_ns = now_ns + KEEP_ALIVE_NS;
            Self::send(socket, version, kind::KEEP_ALIVE)?;
        }
        let last_ns = self.beam_ns.unwrap_or(*since_ns);
        let silent_ns = now_ns - last_ns;
        if silent_ns > SILENCES * self.silence_ns {
            return Err(self.silent());
        }
        if now_ns - last_ns.max(self.asked_ns) > self.silence_ns {
            // It may have been started anew, or have missed the first request.
            self.asked_ns = now_ns;
            let ask = match self.decoder.configuration() {
                Some(_) => kind::START_FFT,
                None => kind::CONFIGURATION_REQUEST,
            };
            Self::send(socket, version, ask)?;
        }
        if silent_ns > self.silence_ns {
            self.link = Link::Down(self.silent());
        } else if self.beam_ns.is_some() {
            self.link = Link::Streaming;
            self.backoff.succeeded();
        }
        Ok(())
    }

    fn silent(&self) -> String {
        let what = match self.decoder.configuration() {
            Some(_) => "no beam",
            None => "no configuration",
        };
        let silence_s = self.silence_ns as f64 * 1e-9;
        format!("{what} from {} for more than {silence_s} s", self.address)
    }
}

impl BeamSource for NavtechClient {
    fn poll(&mut self, now_ns: i64, sink: &mut dyn BeamSink) {
        if matches!(self.connection, Connection::None)
            && self.backoff.is_due(now_ns)
            && let Err(errno) = self.connect(now_ns)
        {
            self.lost(self.no_answer(errno), now_ns, sink);
        }
        if let Connection::Connecting { socket, since_ns } = &self.connection {
            let made = Self::established(socket, now_ns - since_ns);
            let watched = made.and_then(|made| {
                let watched = made.then(|| self.poller.now_readable(socket)).transpose();
                watched.map_err(|_| Errno::IO).map(|_| made)
            });
            match watched {
                Ok(false) => return,
                Ok(true) => self.opened(now_ns),
                Err(errno) => self.lost(self.no_answer(errno), now_ns, sink),
            }
        }
        if let Err(why) = self.serve(now_ns, sink) {
            self.lost(why, now_ns, sink);
        }
    }

    fn due_ns(&self) -> i64 {
        match &self.connection {
            Connection::None => self.backoff.due_ns(),
            Connection::Connecting { since_ns, .. } => since_ns + CONNECT_NS,
            Connection::Open {
                since_ns,
                keep_alive_ns,
                ..
            } => {
                let last_ns = self.beam_ns.unwrap_or(*since_ns).max(self.asked_ns);
                (*keep_alive_ns).min(last_ns + self.silence_ns + 1)
            }
        }
    }

    fn reconnect(&mut self, now_ns: i64, sink: &mut dyn BeamSink) {
        // A new connection begins with the radar's configuration: the one in force may be wrong.
        let address = self.address;
        let why = format!("beams from {address}, but no whole sweep; connecting anew");
        self.lost(why, now_ns, sink);
    }

    fn link(&self) -> &Link {
        &self.link
    }

    fn counts(&self, visit: &mut dyn FnMut(Count)) {
        visit(Count::event("connections", self.connects));
        self.decoder.counts(visit);
    }
}

//! What lines come by: a serial port, or datagrams.

use super::senders::Senders;
use crate::port::Port;
use randt_config::SenderPin;
use std::fmt;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;

/// A wire, open or not.
#[derive(Debug)]
pub(super) enum Wire {
    /// A serial port by its path.
    Serial {
        path: PathBuf,
        baud: u32,
        port: Option<Port>,
    },
    /// Datagrams to an address of this host.
    Udp {
        address: SocketAddr,
        socket: Option<UdpSocket>,
        senders: Senders,
    },
}

/// What was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    /// That many bytes of a stream.
    Stream(usize),
    /// A datagram of that many bytes, and its sender.
    Datagram(usize, SocketAddr),
}

impl Wire {
    /// The wire of a text: an address with a port, else a path.
    pub fn new(text: &str, baud: u32, sender: SenderPin, silence_ns: i64) -> Self {
        match text.parse() {
            Ok(address) => Self::Udp {
                address,
                socket: None,
                senders: Senders::new(sender, silence_ns),
            },
            Err(_) => Self::Serial {
                path: PathBuf::from(text),
                baud,
                port: None,
            },
        }
    }

    /// Opens it anew, or gives the reason why not.
    pub fn open(&mut self) -> Result<(), String> {
        self.close();
        match self {
            Self::Serial { path, baud, port } => *port = Some(Port::open(path, *baud)?),
            Self::Udp {
                address, socket, ..
            } => {
                let bound = UdpSocket::bind(*address).and_then(|socket| {
                    socket.set_nonblocking(true)?;
                    Ok(socket)
                });
                let failed = |error: io::Error| {
                    let why = error.kind();
                    format!("cannot listen on {address} ({why}); trying again")
                };
                *socket = Some(bound.map_err(failed)?);
            }
        }
        Ok(())
    }

    pub fn close(&mut self) {
        match self {
            Self::Serial { port, .. } => *port = None,
            Self::Udp { socket, .. } => *socket = None,
        }
    }

    pub fn is_open(&self) -> bool {
        match self {
            Self::Serial { port, .. } => port.is_some(),
            Self::Udp { socket, .. } => socket.is_some(),
        }
    }

    /// Reads what is there; none where nothing is.
    pub fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<Piece>> {
        match self {
            Self::Serial { port, .. } => match port {
                Some(port) => Ok(port.read(bytes)?.map(Piece::Stream)),
                None => Ok(None),
            },
            Self::Udp { socket, .. } => match socket.as_ref().map(|it| it.recv_from(bytes)) {
                None => Ok(None),
                Some(Ok((count, from))) => Ok(Some(Piece::Datagram(count, from))),
                Some(Err(error)) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(None),
                    _ => Err(error),
                },
            },
        }
    }

    /// What to sleep on.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Serial { port, .. } => port.as_ref().map(Port::descriptor),
            Self::Udp { socket, .. } => socket.as_ref().map(AsFd::as_fd),
        }
    }

    /// Who sends datagrams; none for a serial port.
    pub fn senders(&mut self) -> Option<&mut Senders> {
        match self {
            Self::Serial { .. } => None,
            Self::Udp { senders, .. } => Some(senders),
        }
    }

    /// Datagrams of others.
    pub fn refused(&self) -> Option<u64> {
        match self {
            Self::Serial { .. } => None,
            Self::Udp { senders, .. } => Some(senders.refused),
        }
    }
}

impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { path, .. } => write!(f, "{}", path.display()),
            Self::Udp { address, .. } => write!(f, "UDP {address}"),
        }
    }
}

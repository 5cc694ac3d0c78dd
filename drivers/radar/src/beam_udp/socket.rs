//! The socket that beam-udp is received on. Does I/O.

use super::decoder::BeamUdpDecoder;
use crate::poller::open_socket;
use crate::{BeamDecoder, BeamSink, BeamSource, Error, Poller};
use nix::sys::socket::{
    ControlMessageOwned, MsgFlags, SockaddrStorage, recvmsg, setsockopt, sockopt as kernel,
};
use randt_device::{Backoff, Count, Link};
use rustix::net::{self, SocketType, sockopt};
use rustix::time::{ClockId, clock_gettime};
use std::io::IoSliceMut;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::Arc;

/// Room for a datagram; longer ones than the protocol's are cut and refused by their checksum.
const ROOM: usize = 2048;
/// Datagrams until others have their turn: two sweeps of an iSDR-C, or more.
const BATCH: usize = 512;
/// A kernel's stamp that is older means that the date was set meanwhile, ns.
const AGE_MAX_NS: i64 = 10_000_000_000;

/// What is listened on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Listening {
    address: SocketAddr,
    /// The group that `address` is, and the interface to receive it on.
    group: Option<(Ipv4Addr, Ipv4Addr)>,
    receive_buffer: usize,
}

impl Listening {
    /// On an address with port; where that is a group, it is joined on an interface (0.0.0.0: the
    /// kernel chooses).
    pub fn new(
        address: SocketAddr,
        interface: Ipv4Addr,
        receive_buffer: usize,
    ) -> Result<Self, Error> {
        let group = match address.ip() {
            IpAddr::V4(ip) if ip.is_multicast() => Some((ip, interface)),
            IpAddr::V6(ip) if ip.is_multicast() => return Err(Error::Group(address)),
            _ => None,
        };
        Ok(Self {
            address,
            group,
            receive_buffer,
        })
    }

    /// An open socket and the size of its receive buffer.
    fn open(&self) -> std::io::Result<(OwnedFd, usize)> {
        let socket = open_socket(&self.address, SocketType::DGRAM)?;
        // Only with CAP_NET_ADMIN may it exceed net.core.rmem_max.
        if sockopt::set_socket_recv_buffer_size_force(&socket, self.receive_buffer).is_err() {
            sockopt::set_socket_recv_buffer_size(&socket, self.receive_buffer)?;
        }
        // The kernel gives twice what is asked for, for what it keeps beside the data.
        let got = sockopt::socket_recv_buffer_size(&socket)? / 2;
        setsockopt(&socket, kernel::ReceiveTimestampns, &true)?;
        setsockopt(&socket, kernel::RxqOvfl, &1)?;
        if let Some((group, interface)) = self.group {
            // Several readers of one group on one host are no conflict.
            sockopt::set_socket_reuseaddr(&socket, true)?;
            net::bind(&socket, &self.address)?;
            sockopt::set_ip_add_membership(&socket, &group, &interface)?;
        } else {
            net::bind(&socket, &self.address)?;
        }
        Ok((socket, got))
    }
}

/// A radar that sends beam-udp.
pub struct BeamUdpSocket {
    listening: Listening,
    silence_ns: i64,
    poller: Arc<Poller>,
    decoder: BeamUdpDecoder,
    socket: Option<OwnedFd>,
    backoff: Backoff,
    link: Link,
    /// A warning for as long as beams come.
    warning: Option<String>,
    received: Received,
    kernel_drops: KernelDrops,
    buffers: Buffers,
}

/// What came by the socket.
#[derive(Debug, Default)]
struct Received {
    /// Last datagram and last beam, or since when there is none, ns.
    datagram_ns: i64,
    beam_ns: i64,
    /// Whether a beam came since the link was judged last: an open socket alone is no sign of a
    /// radar.
    has_beam: bool,
}

/// Datagrams that the kernel dropped.
#[derive(Debug, Default)]
struct KernelDrops {
    total: u64,
    /// The kernel's counter of this socket.
    of_socket: u32,
}

/// Room for a datagram and the kernel's control messages.
#[derive(Debug)]
struct Buffers {
    datagram: Vec<u8>,
    control: Vec<u8>,
}

impl BeamUdpSocket {
    pub(crate) fn new(
        listening: Listening,
        silence_ns: i64,
        decoder: BeamUdpDecoder,
        poller: Arc<Poller>,
    ) -> Self {
        Self {
            listening,
            silence_ns,
            poller,
            decoder,
            socket: None,
            backoff: Backoff::default(),
            link: Link::Starting,
            warning: None,
            received: Received::default(),
            kernel_drops: KernelDrops::default(),
            buffers: Buffers {
                datagram: vec![0; ROOM],
                control: nix::cmsg_space!(nix::sys::time::TimeSpec, u32),
            },
        }
    }

    fn open_socket(&self) -> std::io::Result<(OwnedFd, usize)> {
        let (socket, got) = self.listening.open()?;
        self.poller.readable(&socket)?;
        Ok((socket, got))
    }

    fn open(&mut self, now_ns: i64) {
        match self.open_socket() {
            Ok((socket, got)) => {
                let asked = self.listening.receive_buffer;
                self.warning = (got < asked).then(|| {
                    format!(
                        "the socket's receive buffer has {got} bytes of {asked}: beams are lost in busy moments; \
                         sysctl -w net.core.rmem_max={asked} fixes it"
                    )
                });
                self.socket = Some(socket);
                self.kernel_drops.of_socket = 0;
                self.received = Received {
                    datagram_ns: now_ns,
                    beam_ns: now_ns,
                    ..self.received
                };
                self.link = Link::Starting;
            }
            Err(error) => {
                let (address, why) = (self.listening.address, error.kind());
                self.link = Link::Down(format!("cannot listen on {address} ({why}); trying again"));
                self.backoff.failed(now_ns);
            }
        }
    }

    /// Takes what has come; an error closes the socket.
    fn receive(&mut self, now_ns: i64, sink: &mut dyn BeamSink) -> nix::Result<()> {
        let Some(socket) = &self.socket else {
            return Ok(());
        };
        let date_ns = date_ns();
        for _ in 0..BATCH {
            let mut room = [IoSliceMut::new(&mut self.buffers.datagram)];
            let control = Some(self.buffers.control.as_mut_slice());
            let message = match recvmsg::<SockaddrStorage>(
                socket.as_raw_fd(),
                &mut room,
                control,
                MsgFlags::empty(),
            ) {
                Ok(message) => message,
                Err(nix::Error::EAGAIN) => return Ok(()),
                Err(nix::Error::EINTR) => continue,
                Err(errno) => return Err(errno),
            };
            let mut arrival_ns = now_ns;
            for control in message.cmsgs()? {
                match control {
                    ControlMessageOwned::ScmTimestampns(stamp) => {
                        let stamp_ns = stamp.tv_sec() * 1_000_000_000 + stamp.tv_nsec();
                        let age_ns = date_ns - stamp_ns;
                        // What came while this batch was read is a little younger than it.
                        if (-AGE_MAX_NS..AGE_MAX_NS).contains(&age_ns) {
                            arrival_ns = now_ns - age_ns;
                        }
                    }
                    ControlMessageOwned::RxqOvfl(dropped) => {
                        let more = dropped.wrapping_sub(self.kernel_drops.of_socket);
                        self.kernel_drops.total += u64::from(more);
                        self.kernel_drops.of_socket = dropped;
                    }
                    _ => {}
                }
            }
            self.decoder.sent_from(message.address.and_then(address_of));
            let count = message.bytes;
            let bytes = self.buffers.datagram.get(..count).unwrap_or_default();
            let received = &mut self.received;
            received.datagram_ns = now_ns;
            self.decoder.decode(bytes, arrival_ns, &mut |beam| {
                (received.beam_ns, received.has_beam) = (now_ns, true);
                sink.beam(beam);
            });
        }
        Ok(())
    }

    fn judge(&mut self, now_ns: i64) {
        let silence_s = self.silence_ns as f64 * 1e-9;
        let address = self.listening.address;
        if now_ns - self.received.beam_ns <= self.silence_ns {
            if std::mem::take(&mut self.received.has_beam) || self.link.streams() {
                self.backoff.succeeded();
                let warning = self.warning.clone();
                self.link = warning.map_or(Link::Streaming, Link::Warning);
            }
            return;
        }
        if self.link.streams() {
            // What is half joined will not be joined any more.
            self.decoder.restart();
        }
        let text = if now_ns - self.received.datagram_ns <= self.silence_ns {
            let pinned = self.decoder.pinned();
            format!("datagrams on {address}, but no beam{pinned} for more than {silence_s} s")
        } else {
            format!("no datagram on {address} for more than {silence_s} s")
        };
        self.link = Link::Down(text);
    }

    /// Joins the group anew as long as nothing comes: an interface that is unplugged loses its
    /// groups, and the socket gets no error.
    fn join_again(&mut self, now_ns: i64) {
        let is_silent = matches!(self.link, Link::Down(_));
        if is_silent && self.listening.group.is_some() && self.backoff.is_due(now_ns) {
            // First: where the new interface has the old one's number, the kernel takes both
            // memberships for one.
            self.socket = None;
            // As long as the interface is away this fails, and is reported when it is tried again.
            self.socket = self.open_socket().ok().map(|(socket, _)| socket);
            self.kernel_drops.of_socket = 0;
            self.backoff.failed(now_ns);
        }
    }
}

/// Where a datagram came from.
fn address_of(address: SockaddrStorage) -> Option<SocketAddr> {
    let v4 = address.as_sockaddr_in().copied();
    let v6 = address.as_sockaddr_in6().copied();
    v4.map(|v4| SocketAddr::V4(v4.into()))
        .or(v6.map(|v6| SocketAddr::V6(v6.into())))
}

/// The date: the kernel's stamps are of its clock.
fn date_ns() -> i64 {
    let time = clock_gettime(ClockId::Realtime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

impl BeamSource for BeamUdpSocket {
    fn poll(&mut self, now_ns: i64, sink: &mut dyn BeamSink) {
        if self.socket.is_none() && self.backoff.is_due(now_ns) {
            self.open(now_ns);
        }
        if let Err(errno) = self.receive(now_ns, sink) {
            let why = std::io::Error::from(errno).kind();
            self.link = Link::Down(format!("the socket failed ({why}); opening it anew"));
            self.socket = None;
            self.backoff.failed(now_ns);
        }
        if self.socket.is_some() {
            self.judge(now_ns);
            self.join_again(now_ns);
        }
    }

    fn due_ns(&self) -> i64 {
        match (&self.socket, &self.link) {
            (None, _) => self.backoff.due_ns(),
            (Some(_), Link::Down(_)) if self.listening.group.is_some() => self.backoff.due_ns(),
            // It is reported already; the next datagram wakes.
            (Some(_), Link::Down(_)) => i64::MAX,
            (Some(_), _) => self.received.beam_ns.saturating_add(self.silence_ns + 1),
        }
    }

    fn reconnect(&mut self, _: i64, _: &mut dyn BeamSink) {
        self.decoder.restart();
    }

    fn link(&self) -> &Link {
        &self.link
    }

    fn counts(&self, visit: &mut dyn FnMut(Count)) {
        self.decoder.counts(visit);
        let dropped = self.kernel_drops.total;
        visit(Count::event("datagrams_dropped_by_the_kernel", dropped));
    }
}

//! One descriptor to sleep on, whatever socket is open at the moment.

use crate::Error;
use rustix::event::epoll::{self, CreateFlags, EventData, EventFlags};
use rustix::net::{self, AddressFamily, SocketFlags, SocketType};
use std::net::SocketAddr;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

/// An epoll set: readable while one of its sockets has something. A socket that is closed leaves
/// it by itself.
#[derive(Debug)]
pub struct Poller {
    epoll: OwnedFd,
}

impl Poller {
    /// An empty set.
    pub fn new() -> Result<Self, Error> {
        let epoll =
            epoll::create(CreateFlags::CLOEXEC).map_err(|errno| Error::Poller(errno.into()))?;
        Ok(Self { epoll })
    }

    /// What to sleep on.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.epoll.as_fd()
    }

    /// Wakes when a socket can be read.
    pub(crate) fn readable(&self, socket: &OwnedFd) -> std::io::Result<()> {
        Ok(epoll::add(
            &self.epoll,
            socket,
            EventData::new_u64(0),
            EventFlags::IN,
        )?)
    }

    /// Wakes when a socket can be written, that is when it is connected or is not going to be.
    pub(crate) fn writable(&self, socket: &OwnedFd) -> std::io::Result<()> {
        Ok(epoll::add(
            &self.epoll,
            socket,
            EventData::new_u64(0),
            EventFlags::OUT,
        )?)
    }

    /// A connected socket: from now on reading counts.
    pub(crate) fn now_readable(&self, socket: &OwnedFd) -> std::io::Result<()> {
        Ok(epoll::modify(
            &self.epoll,
            socket,
            EventData::new_u64(0),
            EventFlags::IN,
        )?)
    }
}

/// A socket that waits for nothing, for an address of either family.
pub(crate) fn open_socket(address: &SocketAddr, kind: SocketType) -> rustix::io::Result<OwnedFd> {
    let family = match address {
        SocketAddr::V4(_) => AddressFamily::INET,
        SocketAddr::V6(_) => AddressFamily::INET6,
    };
    let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
    net::socket_with(family, kind, flags, None)
}

//! One descriptor to sleep on, whatever socket is open at the moment.

use crate::Error;
use rustix::event::epoll::{self, CreateFlags, EventData, EventFlags};
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

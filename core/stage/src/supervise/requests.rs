//! What systemd requests of a stage by signals.

use crate::{Error, ports::Descriptor};
use nix::sys::signal::{SigSet, Signal};
use nix::sys::signalfd::{SfdFlags, SignalFd};
use std::os::fd::AsFd;

/// What may be requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// The end.
    Stop,
    /// The configuration read again.
    Reload,
}

/// The requests. SIGTERM is among them because systemd sends a SIGCONT right behind it, and
/// iceoryx2 remembers only the last signal: now and then a stage would not notice that it has to
/// end.
#[derive(Debug)]
pub(crate) struct Requests(SignalFd);

impl Requests {
    /// Takes both signals from now on. Call it before there is another thread: a thread that has
    /// not blocked them dies of them.
    pub(crate) fn new() -> Result<Self, Error> {
        let mut signals = SigSet::empty();
        signals.add(Signal::SIGHUP);
        signals.add(Signal::SIGTERM);
        let fd = signals.thread_block().and_then(|()| {
            let flags = SfdFlags::SFD_NONBLOCK | SfdFlags::SFD_CLOEXEC;
            SignalFd::with_flags(&signals, flags)
        });
        Ok(Self(fd.map_err(|cause| {
            Error::bus("SIGHUP and SIGTERM", cause)
        })?))
    }

    /// What to sleep on.
    pub(crate) fn descriptor(&self) -> Result<Descriptor<'_>, Error> {
        Descriptor::new(self.0.as_fd())
    }

    /// A request that was made since the last call.
    pub(crate) fn take(&self) -> Option<Request> {
        let signal = self.0.read_signal().ok().flatten()?;
        let is_end = signal.ssi_signo == Signal::SIGTERM as u32;
        Some(if is_end {
            Request::Stop
        } else {
            Request::Reload
        })
    }
}

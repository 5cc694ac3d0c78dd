//! What a stage sleeps on.

use super::{BusResource, Subscriber};
use crate::Error;
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{
    CallbackProgression, FileDescriptor, FileDescriptorBased, SynchronousMultiplexing, WaitSet,
    WaitSetBuilder, ipc,
};
use iceoryx2::waitset::WaitSetRunResult;
use randt_messages::Topic;
use std::fmt::Debug;
use std::marker::PhantomData;
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::Duration;

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WakeReason {
    /// Something came: poll all ports, and [`crate::Stage::take_changed`] where a configuration is
    /// taken live.
    Event,
    /// The time was over.
    Timeout,
    /// The end was requested: SIGTERM or Ctrl-C.
    Stop,
}

/// Something that can wake a stage.
pub trait Waitable {
    #[doc(hidden)]
    fn attachment(&self) -> &dyn Attachment;
    #[doc(hidden)]
    fn take_notices(&self);
}

/// What the kernel is asked to watch.
#[doc(hidden)]
pub trait Attachment: SynchronousMultiplexing + Debug {}
impl<A: SynchronousMultiplexing + Debug> Attachment for A {}

impl<T: Topic> Waitable for Subscriber<T> {
    fn attachment(&self) -> &dyn Attachment {
        &*self.listener
    }

    fn take_notices(&self) {
        self.drain();
    }
}

/// A socket, a serial port, a pipe: wakes a stage as long as there is something to read, or its
/// other end is closed.
#[derive(Debug)]
pub struct Descriptor<'fd> {
    watched: FileDescriptor,
    _open: PhantomData<BorrowedFd<'fd>>,
}

impl<'fd> Descriptor<'fd> {
    /// Watches a descriptor that the caller keeps.
    pub fn new(fd: BorrowedFd<'fd>) -> Result<Self, Error> {
        let number = fd.as_raw_fd();
        let watched = FileDescriptor::non_owning_new(number)
            .ok_or_else(|| Error::bus("waiting for a device", format!("descriptor {number}")))?;
        Ok(Self {
            watched,
            _open: PhantomData,
        })
    }
}

impl FileDescriptorBased for Descriptor<'_> {
    fn file_descriptor(&self) -> &FileDescriptor {
        &self.watched
    }
}

impl SynchronousMultiplexing for Descriptor<'_> {}

impl Waitable for Descriptor<'_> {
    fn attachment(&self) -> &dyn Attachment {
        self
    }

    /// Its owner reads it until it is empty.
    fn take_notices(&self) {}
}

/// What happened in one sleep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaitOutcome {
    /// The end was requested.
    pub stop: bool,
    /// Something that was slept on has something.
    pub events: bool,
    /// A reader has joined one of the topics.
    pub joins: bool,
}

/// The kernel's part of waiting.
pub(super) struct PortWaiter {
    joined: BusResource<Listener<ipc::Service>>,
    set: WaitSet<ipc::Service>,
}

impl PortWaiter {
    /// Always sleeps on `joined` too.
    pub(super) fn new(joined: BusResource<Listener<ipc::Service>>) -> Result<Self, Error> {
        let set = WaitSetBuilder::new()
            .create::<ipc::Service>()
            .map_err(|cause| Error::bus("the wait set", cause))?;
        Ok(Self { joined, set })
    }

    /// Sleeps once, at most for `pause`. Notices that came are taken: otherwise they would wake
    /// the stage for ever.
    pub(super) fn sleep(
        &self,
        on: &[&dyn Waitable],
        pause: Duration,
    ) -> Result<WaitOutcome, Error> {
        let attach = |attachment| {
            let attached = self.set.attach_notification::<dyn Attachment>(attachment);
            attached.map_err(|cause| Error::bus("something to wait for", cause))
        };
        let joined = attach(&*self.joined)?;
        let guards = on
            .iter()
            .map(|waitable| attach(waitable.attachment()))
            .collect::<Result<Vec<_>, _>>()?;
        let (mut joins, mut events) = (false, false);
        let result = self.set.wait_and_process_once_with_timeout(
            |id| {
                joins |= id.has_event_from(&joined);
                events |= guards.iter().any(|guard| id.has_event_from(guard));
                CallbackProgression::Continue
            },
            pause,
        );
        if joins {
            // The notice carries no data, and a failure to take it is met again at the next sleep.
            let _ = self.joined.try_wait(|_| {});
        }
        if events {
            on.iter().for_each(|waitable| waitable.take_notices());
        }
        // An interrupt is any signal, also the one that continues a stopped process.
        let result = result.map_err(|cause| Error::bus("waiting", cause))?;
        Ok(WaitOutcome {
            stop: matches!(result, WaitSetRunResult::TerminationRequest),
            events,
            joins,
        })
    }
}

//! What a stage sleeps on.

use crate::{Error, Subscriber};
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{CallbackProgression, WaitSet, WaitSetBuilder, ipc};
use iceoryx2::waitset::WaitSetRunResult;
use randt_messages::Topic;
use std::fmt::Debug;
use std::time::Duration;

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Woken {
    /// Something came; ask all ports.
    Event,
    /// The time was over.
    Timeout,
    /// The end was asked for: SIGTERM or Ctrl-C.
    Stop,
}

/// Something that can wake a stage.
pub trait Wakes: Debug {
    #[doc(hidden)]
    fn listener(&self) -> &Listener<ipc::Service>;
    #[doc(hidden)]
    fn take_notices(&self);
}

impl<T: Topic> Wakes for Subscriber<T> {
    fn listener(&self) -> &Listener<ipc::Service> {
        &self.listener
    }

    fn take_notices(&self) {
        self.drain();
    }
}

/// What happened in one sleep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slept {
    /// The end was asked for.
    pub stop: bool,
    /// Something that was slept on has something.
    pub events: bool,
    /// Somebody began to read one of the topics.
    pub joins: bool,
}

/// The kernel's part of waiting.
pub(crate) struct Waits {
    joined: Listener<ipc::Service>,
    set: WaitSet<ipc::Service>,
}

impl Waits {
    /// Always sleeps on `joined` too.
    pub(crate) fn new(joined: Listener<ipc::Service>) -> Result<Self, Error> {
        let set = WaitSetBuilder::new()
            .create::<ipc::Service>()
            .map_err(|cause| Error::bus("the wait set", cause))?;
        Ok(Self { joined, set })
    }

    /// Sleeps once, at most so long. Notices that came are taken: without that they would wake the stage for ever.
    pub(crate) fn sleep(&self, on: &[&dyn Wakes], pause: Duration) -> Result<Slept, Error> {
        let attach = |listener| {
            let attached = self.set.attach_notification(listener);
            attached.map_err(|cause| Error::bus("waiting for a topic", cause))
        };
        let joined = attach(&self.joined)?;
        let guards = on
            .iter()
            .map(|wakes| attach(wakes.listener()))
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
            // The notice says no more than "look", and a failure to take it is met again at the next sleep.
            let _ = self.joined.try_wait(|_| {});
        }
        if events {
            on.iter().for_each(|wakes| wakes.take_notices());
        }
        // An interrupt is any signal, the one that continues a stopped process too.
        let result = result.map_err(|cause| Error::bus("waiting", cause))?;
        Ok(Slept {
            stop: matches!(result, WaitSetRunResult::TerminationRequest),
            events,
            joins,
        })
    }
}

//! The reading end of a topic.

use super::bus::{Bus, Service};
use super::{BusResource, PortCounters, wire::Wire};
use crate::Error;
use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use randt_messages::{MessageRef, Topic};
use std::marker::PhantomData;
use std::rc::Rc;
use std::time::Duration;

/// Reads one topic, in order, and counts what it missed.
#[derive(Debug)]
pub struct Subscriber<T: Topic> {
    port: BusResource<Port<ipc::Service, [u8], Wire<T>>>,
    pub(super) listener: BusResource<Listener<ipc::Service>>,
    counters: Rc<PortCounters>,
    /// Epoch and sequence of the last message, of the publisher that sent it.
    last: Option<(u64, u64)>,
}

/// A message in shared memory; it stays there until this is dropped.
#[derive(Debug)]
pub struct Received<T: Topic> {
    sample: Sample<ipc::Service, [u8], Wire<T>>,
    _topic: PhantomData<T>,
}

impl<T: Topic> Subscriber<T> {
    pub(crate) fn new(
        bus: &Bus,
        service: &Service<T>,
        counters: Rc<PortCounters>,
    ) -> Result<Self, Error> {
        // The listener first: no message that comes to the port may go unnoticed.
        let listener = bus.listener(T::NAME)?;
        let port = bus.retry(T::NAME, || {
            service
                .subscriber_builder()
                .set_degradation_handler(bus.exhausted.on_failure())
                .create()
        })?;
        Ok(Self {
            port: bus.memory_loss.guard(port),
            listener,
            counters,
            last: None,
        })
    }

    /// The next message, if there is one. A message whose bytes are no whole number of items is
    /// counted as lost.
    pub fn receive(&mut self) -> Result<Option<Received<T>>, Error> {
        loop {
            let sample = self
                .port
                .receive()
                .map_err(|cause| Error::bus(format!("{}: receiving", T::NAME), cause))?;
            let Some(sample) = sample else {
                return Ok(None);
            };
            // Items follow the head, a whole number of 8 bytes: they lie as they must be aligned.
            let bytes = sample.payload();
            let is_whole = match size_of::<T::Item>() {
                0 => bytes.is_empty(),
                _ => bytemuck::try_cast_slice::<u8, T::Item>(bytes).is_ok(),
            };
            if !is_whole {
                self.counters.lose(1);
                continue;
            }
            let received = Received {
                sample,
                _topic: PhantomData,
            };
            self.count(&received);
            return Ok(Some(received));
        }
    }

    /// Messages that were missed so far.
    pub fn missed(&self) -> u64 {
        self.counters.health().lost
    }

    /// Continues the count of what is missed after a message that this stage had before it was
    /// restarted.
    pub fn continue_after(&mut self, epoch: u64, sequence: u64) {
        self.last = Some((epoch, sequence));
    }

    /// Takes the notices that have come; without that they would wake the stage for ever.
    pub(crate) fn drain(&self) {
        // A failure does not matter: the messages themselves are read whatever the notices say.
        let _ = self.listener.try_wait(|_| {});
    }

    /// Sleeps until a notice or a signal comes, and takes the notice.
    pub(crate) fn sleep(&self, timeout: Duration) -> Result<(), Error> {
        match self.listener.timed_wait(|_| {}, timeout) {
            // A signal: its handler has run, and the caller goes on.
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(cause) => Err(Error::bus(format!("{}: waiting", T::NAME), cause)),
        }
    }

    fn count(&mut self, received: &Received<T>) {
        let header = received.message().header();
        let (epoch, sequence) = (header.epoch, header.sequence);
        // Another epoch begins anew: what a publisher sent before this reader came was never
        // promised.
        let last = self.last.filter(|last| last.0 == epoch).map(|last| last.1);
        let missed = last.map_or(0, |last| sequence.saturating_sub(last + 1));
        if missed > 0 {
            self.counters.lose(missed);
        }
        if last.is_none_or(|last| last < sequence) {
            self.last = Some((epoch, sequence));
        }
        self.counters.count(header.published_ns);
    }
}

impl<T: Topic> Received<T> {
    /// The message, where it lies.
    pub fn message(&self) -> MessageRef<'_, T> {
        let bytes = self.sample.payload();
        // Size and alignment were seen to when the message was received.
        let items = if size_of::<T::Item>() == 0 {
            &[]
        } else {
            bytemuck::try_cast_slice(bytes).unwrap_or_default()
        };
        MessageRef {
            head: &self.sample.user_header().0,
            items,
        }
    }
}

//! The writing end of a topic.

use super::bus::{Bus, Service};
use super::{BusResource, PortCounters, qos, wire::Wire};
use crate::{Clock, Error, memory::MessageMemory};
use iceoryx2::identifiers::UniqueSubscriberId;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{AllocationStrategy, CallbackProgression, ipc};
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::port_factory::PortFactory;
use randt_messages::{MessageRef, Topic};
use std::cell::RefCell;
use std::mem::MaybeUninit;
use std::rc::Rc;

/// What a publisher and its stage share: the stage delivers the history while the publisher has
/// nothing to send.
#[derive(Debug)]
pub(crate) struct Outgoing<T: Topic> {
    port: BusResource<Port<ipc::Service, [u8], Wire<T>>>,
    notifier: BusResource<Notifier<ipc::Service>>,
}

/// Delivers a writer's history to readers that have joined.
pub(crate) trait HistoryDelivery {
    fn deliver_history(&self);
}

impl<T: Topic> HistoryDelivery for Outgoing<T> {
    fn deliver_history(&self) {
        // A reader that died while it joined is no failure of this stage.
        let _ = self.port.update_connections();
        // The history sends no notice by itself: the reader would sleep until the next message.
        let _ = self.notifier.notify();
    }
}

type UninitSample<T> = SampleMutUninit<ipc::Service, [MaybeUninit<u8>], Wire<T>>;

/// A message in shared memory that no reader sees yet.
#[derive(Debug)]
pub struct Loan<T: Topic> {
    sample: SampleMut<ipc::Service, [u8], Wire<T>>,
}

impl<T: Topic> Loan<T> {
    /// The head, all zero at first.
    pub fn head_mut(&mut self) -> &mut T::Head {
        &mut self.sample.user_header_mut().0
    }

    /// The items, all zero at first, in the number that was asked for.
    pub fn items_mut(&mut self) -> &mut [T::Item] {
        let bytes = self.sample.payload_mut();
        if size_of::<T::Item>() == 0 {
            return &mut [];
        }
        // iceoryx2's memory begins after a header of eight-byte fields, so it suits every item.
        bytemuck::try_cast_slice_mut(bytes).unwrap_or_default()
    }
}

/// Publishes one topic: numbers, stamps and counts what it sends, and wakes the readers.
#[derive(Debug)]
pub struct Publisher<T: Topic> {
    pub(crate) outgoing: Rc<Outgoing<T>>,
    memory: RefCell<MessageMemory>,
    service: BusResource<Service<T>>,
    /// The readers at the last call of [`Self::has_new_reader`].
    readers: Vec<UniqueSubscriberId>,
    counters: Rc<PortCounters>,
    clock: Clock,
    epoch: u64,
    sequence: u64,
}

impl<T: Topic> Publisher<T> {
    pub(crate) fn new(
        bus: &Bus,
        service: BusResource<Service<T>>,
        clock: Clock,
        epoch: u64,
        counters: Rc<PortCounters>,
        is_long_range: bool,
    ) -> Result<Self, Error> {
        let topic = qos::topic::<T>();
        let port = bus.retry(T::NAME, || {
            service
                .publisher_builder()
                .initial_max_slice_len(qos::items_bytes_max(&topic).max(1))
                .allocation_strategy(AllocationStrategy::Static)
                .max_loaned_samples(qos::LOANED)
                .set_degradation_handler(bus.exhausted.on_failure())
                .create()
        })?;
        let usual = qos::items_bytes_usual(&topic, is_long_range);
        let memory = MessageMemory::take(&bus.domain, port.id().value(), topic, usual)?;
        Ok(Self {
            outgoing: Rc::new(Outgoing {
                port: bus.memory_loss.guard(port),
                notifier: bus.notifier(T::NAME)?,
            }),
            memory: RefCell::new(memory),
            service,
            readers: Vec::new(),
            counters,
            clock,
            epoch,
            sequence: 0,
        })
    }

    /// Whether there is a reader that was not there at the last call: what is larger than the
    /// history can then be sent again.
    pub fn has_new_reader(&mut self) -> bool {
        let mut readers = Vec::with_capacity(self.readers.len());
        self.service.dynamic_config().list_subscribers(|reader| {
            readers.push(reader.subscriber_id);
            CallbackProgression::Continue
        });
        let is_new = readers.iter().any(|id| !self.readers.contains(id));
        self.readers = readers;
        is_new
    }

    /// Sends a message. Sequence, epoch and publish time are this publisher's; the rest is as
    /// given.
    pub fn publish(&mut self, message: MessageRef<'_, T>) -> Result<(), Error> {
        let bytes: &[u8] = if size_of::<T::Item>() == 0 {
            &[]
        } else {
            bytemuck::cast_slice(message.items)
        };
        let mut sample = self.loan_bytes(bytes.len())?.write_from_slice(bytes);
        sample.user_header_mut().0 = *message.head;
        self.publish_loan(Loan { sample })
    }

    /// Shared memory for a message with this many items, to be filled in place. Head and items are
    /// zero; one loan at a time.
    pub fn loan(&self, items: usize) -> Result<Loan<T>, Error> {
        let bytes = items.saturating_mul(size_of::<T::Item>());
        let mut sample = self.loan_bytes(bytes)?.write_from_fn(|_| 0);
        sample.user_header_mut().0 = bytemuck::Zeroable::zeroed();
        Ok(Loan { sample })
    }

    fn loan_bytes(&self, bytes: usize) -> Result<UninitSample<T>, Error> {
        self.memory.borrow_mut().reserve(bytes)?;
        let loaned = self.outgoing.port.loan_slice_uninit(bytes);
        loaned.map_err(|cause| Error::bus(format!("{}: memory for a message", T::NAME), cause))
    }

    /// Sends what was filled. Sequence, epoch and publish time are this publisher's.
    pub fn publish_loan(&mut self, loan: Loan<T>) -> Result<(), Error> {
        let mut sample = loan.sample;
        let header = sample.user_header_mut().0.as_mut();
        header.sequence = self.sequence;
        header.epoch = self.epoch;
        header.published_ns = self.clock.now_ns();
        let published_ns = header.published_ns;
        sample
            .send()
            .map_err(|cause| Error::bus(format!("{}: a message", T::NAME), cause))?;
        self.sequence += 1;
        self.counters.count(published_ns);
        // A reader that is gone or has not polled for long cannot be woken; its samples wait for
        // it all the same.
        let _ = self.outgoing.notifier.notify();
        Ok(())
    }
}

//! The ports of a process: topics to write and to read, what it waits for, and what their memory
//! costs.

mod bus;
mod counters;
mod exhausted;
mod publisher;
pub(crate) mod qos;
mod resource;
mod subscriber;
mod waiter;
mod wire;

pub(crate) use bus::{Bus, configuration};
pub(crate) use counters::PortCounters;
pub(crate) use exhausted::exhausted_resource;
pub use publisher::{Loan, Publisher};
pub use qos::bytes_in_use;
pub(crate) use resource::BusResource;
pub use subscriber::{Received, Subscriber};
pub(crate) use waiter::WaitOutcome;
pub use waiter::{Descriptor, Waitable, WakeReason};

use crate::{Error, domain::Membership, memory::MemoryBudget, supervise::LastMessage};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::ipc;
use publisher::HistoryDelivery;
use randt_messages::{MessageRef, PortHealth, StageHealthTopic, Topic};
use std::rc::Rc;
use std::time::Duration;
use waiter::PortWaiter;

/// A process that begins to read a topic notifies its writers by this name, so that they deliver
/// their history at once.
pub(crate) const JOINED: &str = "stage/joined";
/// Shared memory that a process needs beside its topics, such as the services' own tables, bytes.
pub(crate) const TABLE_BYTES: usize = 500_000;

/// All ports of a stage, and the node that they belong to.
pub(crate) struct StagePorts {
    // Fields are dropped in order: ports before the node.
    health: Publisher<StageHealthTopic>,
    join: BusResource<Notifier<ipc::Service>>,
    writers: Vec<Rc<dyn HistoryDelivery>>,
    waiter: PortWaiter,
    pub bus: Bus,
    counters: Vec<Rc<PortCounters>>,
    /// Whether scans are as large as a Navtech's.
    pub is_long_range: bool,
}

impl StagePorts {
    /// Makes the node and the port for health. Call it under the lock of those who start.
    pub(crate) fn open(membership: &mut Membership, budget: &MemoryBudget) -> Result<Self, Error> {
        budget.require("tables", TABLE_BYTES)?;
        let bus = Bus::open(&membership.domain, membership.name())?;
        // Not among the counted ports: it would only report itself.
        let counters = PortCounters::new(StageHealthTopic::NAME, true);
        let health = open_publisher(&bus, membership, budget, counters, false)?;
        Ok(Self {
            writers: vec![Rc::clone(&health.outgoing) as Rc<dyn HistoryDelivery>],
            health,
            waiter: PortWaiter::new(bus.listener(JOINED)?)?,
            join: bus.notifier(JOINED)?,
            bus,
            counters: Vec::new(),
            is_long_range: false,
        })
    }

    /// Opens a topic for writing.
    pub(crate) fn publisher<T: Topic>(
        &mut self,
        membership: &mut Membership,
        budget: &MemoryBudget,
    ) -> Result<Publisher<T>, Error> {
        let counters = self.counters(T::NAME, true);
        let shared = Rc::clone(&counters);
        let publisher = open_publisher(&self.bus, membership, budget, shared, self.is_long_range)?;
        self.keep_counters(counters);
        self.writers
            .push(Rc::clone(&publisher.outgoing) as Rc<dyn HistoryDelivery>);
        Ok(publisher)
    }

    /// Opens a topic for reading and asks its writers for their history.
    pub(crate) fn subscriber<T: Topic>(
        &mut self,
        membership: &mut Membership,
    ) -> Result<Subscriber<T>, Error> {
        let service = self.bus.topic::<T>()?;
        membership.add_topic::<T>()?;
        let counters = self.counters(T::NAME, false);
        let subscriber = Subscriber::new(&self.bus, &service, Rc::clone(&counters))?;
        self.keep_counters(counters);
        // Writers that cannot be woken deliver their history with the next message.
        let _ = self.join.notify();
        Ok(subscriber)
    }

    /// The counters of a topic's ports in this direction; new ones where there is no such port.
    fn counters(&self, topic: &str, publishes: bool) -> Rc<PortCounters> {
        let mut known = self.counters.iter();
        let known = known.find(|port| port.is(topic, publishes));
        known.map_or_else(|| PortCounters::new(topic, publishes), Rc::clone)
    }

    /// From now on health has them.
    fn keep_counters(&mut self, counters: Rc<PortCounters>) {
        let mut known = self.counters.iter();
        if !known.any(|known| Rc::ptr_eq(known, &counters)) {
            self.counters.push(counters);
        }
    }

    /// What went through each port.
    pub(crate) fn health(&self) -> Vec<PortHealth> {
        self.counters.iter().map(|port| port.health()).collect()
    }

    /// The message that the first writer sent last, in this epoch.
    pub(crate) fn last_message(&self, epoch: u64) -> LastMessage {
        let mut ports = self.counters.iter().map(|port| port.health());
        let sent = ports.find(|port| port.publishes == 1);
        LastMessage {
            epoch,
            sequence: sent.and_then(|port| port.messages.checked_sub(1)),
        }
    }

    /// What a topic costs in memory, as a line for people.
    pub(crate) fn budget<T: Topic>(&self) -> String {
        qos::budget(&qos::topic::<T>(), self.is_long_range)
    }

    pub(crate) fn publish_health(
        &mut self,
        health: MessageRef<'_, StageHealthTopic>,
    ) -> Result<(), Error> {
        self.health.publish(health)
    }

    /// Sleeps once, and delivers the history to readers that have joined meanwhile.
    pub(crate) fn sleep(
        &self,
        on: &[&dyn Waitable],
        pause: Duration,
    ) -> Result<WaitOutcome, Error> {
        let outcome = self.waiter.sleep(on, pause)?;
        if outcome.joins {
            let writers = self.writers.iter();
            writers.for_each(|writer| writer.deliver_history());
        }
        Ok(outcome)
    }
}

/// Opens a topic for writing, if there is memory for it.
fn open_publisher<T: Topic>(
    bus: &Bus,
    membership: &mut Membership,
    budget: &MemoryBudget,
    counters: Rc<PortCounters>,
    is_long_range: bool,
) -> Result<Publisher<T>, Error> {
    let bytes = bytes_in_use(&qos::topic::<T>(), is_long_range);
    budget.require(T::NAME, bytes)?;
    let service = bus.topic::<T>()?;
    membership.add_topic::<T>()?;
    let (clock, epoch) = (membership.clock, membership.epoch());
    Publisher::new(bus, service, clock, epoch, counters, is_long_range)
}

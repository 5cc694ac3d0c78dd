//! Looking at a pipeline without being part of it.

use crate::{
    Clock, Domain, Error, Presence, Subscriber,
    bus::Bus,
    dead_node_cleanup::clean_up_before_start,
    held::Held,
    memory::Memory,
    memory_watch::MemoryWatch,
    ports::PortCounters,
    preallocation::take_tables,
    stage::{BESIDE, JOINED},
};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{CallbackProgression, WaitSetBuilder, ipc};
use iceoryx2::waitset::WaitSetRunResult;
use randt_messages::{MessageRef, Topic};
use std::fs::File;
use std::time::Duration;

/// A process that watches: it is present, so that nobody wipes the domain under it, but not in the register; it publishes
/// nothing, so that several may run, and holds nobody up, however seldom it looks.
pub struct Observer {
    // Ports go before the node, the node before the presence: fields are dropped in order.
    join: Held<Notifier<ipc::Service>>,
    bus: Bus,
    memory: MemoryWatch,
    presence: Presence,
    _place: File,
    domain: Domain,
    clock: Clock,
}

impl Observer {
    /// Enters the domain, where a stage is in it.
    pub fn enter(domain: &Domain) -> Result<Option<Self>, Error> {
        let Some(presence) = domain.visit()? else {
            return Ok(None);
        };
        let place = domain.place_to_watch()?;
        let _start = domain.start()?;
        clean_up_before_start(domain)?;
        Memory::new("top").need("tables", BESIDE)?;
        let bus = Bus::open(domain, &format!("top-{}", std::process::id()))?;
        Ok(Some(Self {
            join: bus.notifier(JOINED)?,
            memory: MemoryWatch::new(domain, bus.node_id()),
            bus,
            presence,
            _place: place,
            domain: domain.clone(),
            clock: Clock::of(domain)?,
        }))
    }

    /// The one clock.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Fails where the memory that it reads was removed or cut: leave it then, and enter anew.
    pub fn check_memory(&self) -> Result<(), Error> {
        let gone = self.memory.check("top", &self.presence);
        if gone.is_err() {
            self.bus.gone().set();
        }
        gone
    }

    /// Opens a topic for reading. Open one that a stage has open, and drop it when none has any more: as long as it is
    /// open nobody can come back with another layout.
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, Error> {
        let _start = self.domain.start()?;
        let service = self.bus.topic::<T>()?;
        let subscriber = Subscriber::new(&self.bus, &service, PortCounters::new(T::NAME, false))?;
        take_tables(&self.domain)?;
        // Writers that cannot be woken hand their history over with the next message.
        let _ = self.join.notify();
        Ok(subscriber)
    }

    /// Hands over what has come since it looked last; never waits.
    pub fn read<T: Topic>(
        &self,
        subscriber: &mut Subscriber<T>,
        mut each: impl FnMut(MessageRef<'_, T>),
    ) -> Result<(), Error> {
        self.bus.exhausted.check()?;
        // Nobody waits for the notices; they are taken so that they do not pile up.
        subscriber.drain();
        while let Some(received) = subscriber.receive()? {
            each(received.message());
        }
        Ok(())
    }
}

/// Whether this process was asked to end (SIGTERM or Ctrl-C) since it was called last. For programs that wait for
/// something else than a stage does: iceoryx2 has these signals, and other handlers would be lost to it.
pub fn stop_requested() -> bool {
    let Ok(waits) = WaitSetBuilder::new().create::<ipc::Service>() else {
        return false;
    };
    // It asks for signals before it finds that there is nothing to wait for.
    let asked =
        waits.wait_and_process_once_with_timeout(|_| CallbackProgression::Stop, Duration::ZERO);
    matches!(asked, Ok(WaitSetRunResult::TerminationRequest))
}

//! Watching a pipeline without being part of it.

use crate::{
    Clock, Domain, Error, Presence, Subscriber,
    dead_node_cleanup::clean_up_before_start,
    memory::{MemoryBudget, MemoryWatch, take_tables},
    ports::{Bus, BusResource, JOINED, PortCounters, TABLE_BYTES},
};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{CallbackProgression, WaitSetBuilder, ipc};
use iceoryx2::waitset::WaitSetRunResult;
use randt_messages::{MessageRef, Topic};
use std::fs::File;
use std::time::Duration;

/// A process that watches. It is present, so that the domain is not wiped under it, but not in the
/// register. It publishes nothing, so that several may run, and holds no stage up, however seldom
/// it polls.
pub struct Observer {
    // Ports go before the node, the node before the presence: fields are dropped in order.
    join: BusResource<Notifier<ipc::Service>>,
    bus: Bus,
    memory_watch: MemoryWatch,
    presence: Presence,
    _watcher_lock: File,
    domain: Domain,
    clock: Clock,
}

impl Observer {
    /// Enters the domain, if a stage is in it.
    pub fn enter(domain: &Domain) -> Result<Option<Self>, Error> {
        let Some(presence) = domain.visit()? else {
            return Ok(None);
        };
        let watcher_lock = domain.watcher_lock()?;
        let _start = domain.start()?;
        clean_up_before_start(domain)?;
        MemoryBudget::new("top").require("tables", TABLE_BYTES)?;
        let bus = Bus::open(domain, &format!("top-{}", std::process::id()))?;
        Ok(Some(Self {
            join: bus.notifier(JOINED)?,
            memory_watch: MemoryWatch::new(domain, bus.node_id()),
            bus,
            presence,
            _watcher_lock: watcher_lock,
            domain: domain.clone(),
            clock: Clock::in_domain(domain)?,
        }))
    }

    /// The one clock.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Fails if the memory that it reads was removed or cut: leave it then, and enter anew.
    pub fn check_memory(&self) -> Result<(), Error> {
        self.memory_watch.check("top", &self.presence, &self.bus)
    }

    /// Opens a topic for reading. Open one that a stage has open, and drop it when none has any
    /// more: as long as it is open no stage can come back with another layout.
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, Error> {
        let _start = self.domain.start()?;
        let service = self.bus.topic::<T>()?;
        let subscriber = Subscriber::new(&self.bus, &service, PortCounters::new(T::NAME, false))?;
        take_tables(&self.domain)?;
        // Writers that cannot be woken deliver their history with the next message.
        let _ = self.join.notify();
        Ok(subscriber)
    }

    /// Passes on what has come since the last call; never waits.
    pub fn read<T: Topic>(
        &self,
        subscriber: &mut Subscriber<T>,
        mut each: impl FnMut(MessageRef<'_, T>),
    ) -> Result<(), Error> {
        self.bus.exhausted.check()?;
        // The notices wake nothing here; they are taken so that they do not pile up.
        subscriber.drain();
        while let Some(received) = subscriber.receive()? {
            each(received.message());
        }
        Ok(())
    }

    /// Sleeps until a message of a topic comes, at most for a time. Signals keep the handlers that
    /// they have.
    pub fn wait<T: Topic>(
        &self,
        subscriber: &Subscriber<T>,
        timeout: Duration,
    ) -> Result<(), Error> {
        self.bus.exhausted.check()?;
        subscriber.sleep(timeout)
    }
}

/// Whether the end of this process was requested (SIGTERM or Ctrl-C) since the last call. For
/// programs that wait for something else than a stage does: iceoryx2 takes these signals, and
/// would replace other handlers.
pub fn stop_requested() -> bool {
    let Ok(wait_set) = WaitSetBuilder::new().create::<ipc::Service>() else {
        return false;
    };
    // It checks the signals before it finds that there is nothing to wait for.
    let result =
        wait_set.wait_and_process_once_with_timeout(|_| CallbackProgression::Stop, Duration::ZERO);
    matches!(result, Ok(WaitSetRunResult::TerminationRequest))
}

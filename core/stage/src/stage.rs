//! A stage: a process of the pipeline, from its start to its end.

use crate::{
    Clock, Domain, Error, Presence, Publisher, Qos, Registry, Subscriber,
    bus::Bus,
    dead_node_cleanup::clean_up_before_start,
    health::{Condition, PERIOD_NS},
    held::Held,
    journal::{Journal, Moment, Priority},
    memory::Memory,
    memory_watch::MemoryWatch,
    ports::PortCounters,
    preallocation::take_tables,
    publisher::HandsOver,
    reload::Asked,
    supervised::Supervised,
    wait::{PortWaiter, Slept, Waitable, WakeReason},
};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::ipc;
use randt_config::{Config, SelectionArguments, Sensor};
use randt_messages::{MessageRef, StageHealthTopic, StageState, Topic};
use std::fs::File;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Whoever begins to read a topic tells the writers by this name, so that they hand over their history at once.
pub(crate) const JOINED: &str = "stage/joined";
/// What a process needs beside its topics: services' own tables, checkpoints' folders and the like, bytes.
pub(crate) const BESIDE: usize = 500_000;

/// Radars that see farther than this send scans like a Navtech's, others like an iSDR-C's.
const LONG_RANGE_M: f64 = 50.0;

/// A process of the pipeline.
pub struct Stage {
    // Ports go before the node, the node before the presence: fields are dropped in order.
    health: Publisher<StageHealthTopic>,
    join: Held<Notifier<ipc::Service>>,
    writers: Vec<Rc<dyn HandsOver>>,
    waits: PortWaiter,
    bus: Bus,
    registry: Registry,
    presence: Presence,
    /// Held until the loop begins.
    start: Option<File>,
    domain: Domain,
    clock: Clock,
    condition: Condition,
    journal: Journal,
    supervised: Supervised,
    /// A configuration that waits to be taken.
    changed: Option<Config>,
    ports: Vec<Rc<PortCounters>>,
    next_health_ns: i64,
    navtech: bool,
    memory: Memory,
    watch: MemoryWatch,
}

impl Stage {
    /// Enters the domain under a name; refuses where that name is taken or memory is short. One a process: a second one
    /// would take the first one for dead, because a process does not see its own locks.
    pub fn open(name: &str, domain: &Domain) -> Result<Self, Error> {
        let supervised = Supervised::begin()?;
        let presence = domain.enter()?;
        let clock = Clock::of(domain)?;
        let started_ns = clock.now_ns();
        let mut registry = Registry::enter(domain, name, started_ns)?;
        let start = domain.start()?;
        // Before memory is counted: that of a dead one is free.
        clean_up_before_start(domain)?;
        let memory = Memory::new(name);
        memory.need("tables", BESIDE)?;
        let bus = Bus::open(domain, name)?;
        let qos = Qos::of::<StageHealthTopic>();
        memory.need(StageHealthTopic::NAME, qos.bytes_in_use(false))?;
        let service = bus.topic::<StageHealthTopic>()?;
        registry.add_topic(StageHealthTopic::NAME, StageHealthTopic::TYPE_NAME)?;
        let epoch = started_ns.unsigned_abs();
        // Not among the ports that are reported: it would only report itself.
        let counters = PortCounters::new(StageHealthTopic::NAME, true);
        let health = Publisher::new(&bus, service, clock, epoch, counters, false)?;
        let waits = PortWaiter::new(bus.listener(JOINED)?)?;
        let watch = MemoryWatch::new(domain, bus.node_id());
        registry.set_left_files(watch.left())?;
        let stage = Self {
            writers: vec![Rc::clone(&health.outgoing) as Rc<dyn HandsOver>],
            health,
            join: bus.notifier(JOINED)?,
            waits,
            bus,
            presence,
            start: Some(start),
            domain: domain.clone(),
            clock,
            condition: Condition {
                name: name.to_owned(),
                started_ns,
                restarts: registry.entry().starts - 1,
                state: StageState::Starting,
                message: String::new(),
                lost: 0,
            },
            journal: Journal::open(name),
            supervised,
            changed: None,
            registry,
            ports: Vec::new(),
            next_health_ns: i64::MAX,
            navtech: false,
            memory,
            watch,
        };
        stage.log_info(&qos.budget(false));
        Ok(stage)
    }

    /// Says which radar's scans are to be expected: they decide how much memory is needed.
    pub fn expect_sensor(&mut self, sensor: &Sensor) {
        self.navtech = sensor.range_max_m > LONG_RANGE_M;
    }

    /// Says how the configuration is read again on SIGHUP. `reads`: the sections that matter to this stage; `live`: the one
    /// (`radar` or `imu`) that it takes without a restart, by [`Self::take_changed`].
    pub fn follow_configuration(
        &mut self,
        selection: &SelectionArguments,
        config: &Config,
        reads: &[&'static str],
        live: Option<&'static str>,
    ) {
        self.supervised.follow(selection, config, reads, live);
    }

    /// A configuration to take over, once.
    pub fn take_changed(&mut self) -> Option<Config> {
        self.changed.take()
    }

    /// The domain that it is in.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The one clock.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// This process's epoch: new at each start, rising.
    pub fn epoch(&self) -> u64 {
        self.condition.started_ns.unsigned_abs()
    }

    /// Opens a topic for writing.
    pub fn publisher<T: Topic>(&mut self) -> Result<Publisher<T>, Error> {
        let qos = Qos::of::<T>();
        let bytes = qos.bytes_in_use(self.navtech);
        self.memory.need(T::NAME, bytes)?;
        let service = self.bus.topic::<T>()?;
        self.registry.add_topic(T::NAME, T::TYPE_NAME)?;
        let counters = self.port(T::NAME, true);
        let (epoch, navtech) = (self.epoch(), self.navtech);
        let publisher = Publisher::new(&self.bus, service, self.clock, epoch, counters, navtech)?;
        self.writers
            .push(Rc::clone(&publisher.outgoing) as Rc<dyn HandsOver>);
        self.log_info(&qos.budget(self.navtech));
        Ok(publisher)
    }

    /// Opens a topic for reading; who writes it hands over what is in reach.
    pub fn subscriber<T: Topic>(&mut self) -> Result<Subscriber<T>, Error> {
        let service = self.bus.topic::<T>()?;
        self.registry.add_topic(T::NAME, T::TYPE_NAME)?;
        let counters = self.port(T::NAME, false);
        let subscriber = Subscriber::new(&self.bus, &service, counters)?;
        // Writers that cannot be woken hand their history over with the next message.
        let _ = self.join.notify();
        Ok(subscriber)
    }

    /// Refuses where there is no memory for a file in the run folder that is about to be opened.
    pub fn reserve(&self, path: &Path, bytes: usize) -> Result<(), Error> {
        self.memory.need_file(path, bytes)
    }

    fn port(&mut self, topic: &str, publishes: bool) -> Rc<PortCounters> {
        if let Some(known) = self.ports.iter().find(|port| port.is(topic, publishes)) {
            return Rc::clone(known);
        }
        let counters = PortCounters::new(topic, publishes);
        self.ports.push(Rc::clone(&counters));
        counters
    }

    /// The loop begins: tells everybody at once.
    pub fn running(&mut self) -> Result<(), Error> {
        self.condition.state = StageState::Running;
        // Also what the others' ports will write to on this one's account.
        take_tables(&self.domain)?;
        self.start = None;
        self.publish_health()
    }

    /// Says what is wrong, or with an empty text that nothing is; data lost in the stage itself are counted.
    pub fn set_status(&mut self, message: &str, lost: u64) {
        let changed = self.condition.message != message;
        self.condition.lost = lost;
        self.condition.state = if message.is_empty() {
            StageState::Running
        } else {
            StageState::Degraded
        };
        if changed {
            message.clone_into(&mut self.condition.message);
            if !message.is_empty() {
                self.log(Priority::Warning, message);
            }
        }
    }

    /// Says what people may want to know while all is well: not for the journal. Nothing is taken back that
    /// [`Self::set_status`] has said.
    pub fn set_remark(&mut self, message: &str) {
        if self.condition.state == StageState::Running && self.condition.message != message {
            message.clone_into(&mut self.condition.message);
        }
    }

    /// Something that `systemctl status` shall show beside rate and age, such as "trust good".
    pub fn set_status_note(&mut self, note: &str) {
        self.supervised.set_note(note);
    }

    /// There is nothing more to do, but what was sent last stays in reach.
    pub fn finished(&mut self) -> Result<(), Error> {
        self.condition.state = StageState::Finished;
        self.publish_health()
    }

    /// A line for the journal.
    pub fn log_info(&self, text: &str) {
        self.log(Priority::Info, text);
    }

    fn log(&self, priority: Priority, text: &str) {
        let sent = self.ports.iter().map(|port| port.health());
        let sent = sent.into_iter().find(|port| port.publishes == 1);
        let moment = Moment {
            epoch: self.epoch(),
            sequence: sent.and_then(|port| port.messages.checked_sub(1)),
        };
        self.journal.log(priority, moment, text);
    }

    /// Sleeps until one of `on` has something, somebody began to read, or the time is over. Health goes out meanwhile, and
    /// signs of life: a loop that does not come here any more hangs. Fails with [`Error::MemoryGone`] where the memory that it shares was removed or cut.
    pub fn wait(
        &mut self,
        on: &[&dyn Waitable],
        timeout: Option<Duration>,
    ) -> Result<WakeReason, Error> {
        let end = timeout.map(|timeout| Instant::now() + timeout);
        loop {
            self.bus.exhausted.check()?;
            match self.supervised.asked() {
                Some(Asked::Stop) => return Ok(WakeReason::Stop),
                Some(Asked::Reload) if self.reload() => return Ok(WakeReason::Event),
                _ => {}
            }
            let now_ns = self.clock.now_ns();
            if now_ns >= self.next_health_ns {
                // First: telling writes to that memory.
                self.check_memory()?;
                self.publish_health()?;
            }
            let next_ns = self.supervised.works(now_ns).min(self.next_health_ns);
            let to_next = next_ns.saturating_sub(now_ns).max(0);
            let mut pause = Duration::from_nanos(to_next.unsigned_abs());
            if let Some(end) = end {
                pause = pause.min(end.saturating_duration_since(Instant::now()));
            }
            let slept = self.sleep(on, pause)?;
            if slept.stop {
                return Ok(WakeReason::Stop);
            }
            if slept.events {
                return Ok(WakeReason::Event);
            }
            if end.is_some_and(|end| Instant::now() >= end) {
                return Ok(WakeReason::Timeout);
            }
        }
    }

    fn check_memory(&self) -> Result<(), Error> {
        let checked = self.watch.check(&self.condition.name, &self.presence);
        if checked.is_err() {
            self.bus.gone().set();
        }
        checked
    }

    /// Enters the pipeline anew under the same name, after [`Error::MemoryGone`]. Ports are opened again by whoever has them.
    /// For those who cannot start as a process again, because they know more than they have on disk.
    pub fn renew(&mut self) -> Result<(), Error> {
        self.bus.gone().set();
        self.registry.leave();
        let (name, navtech) = (self.condition.name.clone(), self.navtech);
        *self = Self::open(&name, &self.domain.clone())?;
        self.navtech = navtech;
        Ok(())
    }

    fn sleep(&self, on: &[&dyn Waitable], pause: Duration) -> Result<Slept, Error> {
        let request = self.supervised.descriptor()?;
        let request = request.iter().map(|request| request as &dyn Waitable);
        let on: Vec<&dyn Waitable> = on.iter().copied().chain(request).collect();
        let slept = self.waits.sleep(&on, pause)?;
        if slept.joins {
            self.writers.iter().for_each(|writer| writer.hand_over());
        }
        Ok(slept)
    }

    /// Reads the configuration again; gives whether the stage has to take one over. What is wrong
    /// with a file is said, and what was in force stays so.
    fn reload(&mut self) -> bool {
        match self.supervised.read_again(&self.condition.name) {
            Ok(changes) => {
                self.log_info("the configuration was read again");
                changes.says.iter().for_each(|text| self.log_info(text));
                self.changed = changes.live;
            }
            Err(error) => self.log(
                Priority::Error,
                &format!("the configuration stays as it was: {error}"),
            ),
        }
        // Ready again when the loop comes back.
        self.next_health_ns = i64::MIN;
        self.changed.is_some()
    }

    /// Sends health now.
    fn publish_health(&mut self) -> Result<(), Error> {
        let now_ns = self.clock.now_ns();
        self.next_health_ns = now_ns + PERIOD_NS;
        let head = self.condition.health(now_ns, &self.ports);
        let items = &[];
        self.supervised
            .publish_status(now_ns, &self.condition, &self.ports);
        self.health.publish(MessageRef { head: &head, items })
    }

    /// Says goodbye. What was sent last needs a moment to be taken by readers that are just being replaced.
    pub fn close(mut self) -> Result<(), Error> {
        self.condition.state = StageState::Stopping;
        self.publish_health()?;
        std::thread::sleep(PARTING);
        self.registry.end()
    }
}

/// Readers wake within a tenth of a millisecond; this is a hundred times that.
const PARTING: Duration = Duration::from_millis(10);

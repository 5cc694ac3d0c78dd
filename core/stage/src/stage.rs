//! A stage: a process of the pipeline, from its start to its end.

use crate::{
    Clock, Domain, Error, Publisher, Subscriber,
    domain::Membership,
    memory::{MemoryBudget, MemoryWatch, take_tables},
    ports::{StagePorts, WaitOutcome, Waitable, WakeReason},
    supervise::{FollowedConfiguration, Priority, Request, StageStatus, Supervision},
};
use randt_config::{Config, SelectionArguments, Sensor};
use randt_messages::{MessageRef, StageHealthTopic, StageState, Topic};
use std::path::Path;
use std::time::{Duration, Instant};

/// A process of the pipeline: its ports, its membership in the domain, its status, its side
/// towards systemd, and the memory that it shares.
pub struct Stage {
    // Fields are dropped in order: ports and node before the presence in the domain.
    ports: StagePorts,
    membership: Membership,
    status: StageStatus,
    supervision: Supervision,
    budget: MemoryBudget,
    memory_watch: MemoryWatch,
}

impl Stage {
    /// Enters the domain under a name; refuses where that name is taken or memory is short. One
    /// per process: a second one would take the first one for dead, because a process does not see
    /// its own locks.
    pub fn open(name: &str, domain: &Domain) -> Result<Self, Error> {
        let supervision = Supervision::begin(name)?;
        let mut membership = Membership::enter(domain, name)?;
        let budget = MemoryBudget::new(name);
        let ports = StagePorts::open(&mut membership, &budget)?;
        let memory_watch = MemoryWatch::new(domain, ports.bus.node_id());
        membership
            .registry
            .set_left_files(memory_watch.left_files())?;
        let stage = Self {
            ports,
            membership,
            status: StageStatus::starting(),
            supervision,
            budget,
            memory_watch,
        };
        stage.log_info(&stage.ports.budget::<StageHealthTopic>());
        Ok(stage)
    }

    /// Sets which radar's scans are expected: they decide how much memory is needed.
    pub fn expect_sensor(&mut self, sensor: &Sensor) {
        self.ports.is_long_range = sensor.range_max_m > LONG_RANGE_M;
    }

    /// Sets how the configuration is read again on SIGHUP. `reads`: the sections that matter to
    /// this stage; `live`: the one (`radar` or `imu`) that it takes without a restart, by
    /// [`Self::take_changed`].
    pub fn follow_configuration(
        &mut self,
        selection: &SelectionArguments,
        config: &Config,
        reads: &[&'static str],
        live: Option<&'static str>,
    ) {
        let followed = FollowedConfiguration::new(selection, config, reads, live);
        self.supervision.follow(followed);
    }

    /// A configuration to take over, once.
    pub fn take_changed(&mut self) -> Option<Config> {
        self.supervision.take_changed()
    }

    /// The domain that it is in.
    pub fn domain(&self) -> &Domain {
        &self.membership.domain
    }

    /// The one clock.
    pub fn clock(&self) -> Clock {
        self.membership.clock
    }

    /// This process's epoch: new at each start, rising.
    pub fn epoch(&self) -> u64 {
        self.membership.epoch()
    }

    /// Opens a topic for writing.
    pub fn publisher<T: Topic>(&mut self) -> Result<Publisher<T>, Error> {
        let publisher = self.ports.publisher(&mut self.membership, &self.budget)?;
        self.log_info(&self.ports.budget::<T>());
        Ok(publisher)
    }

    /// Opens a topic for reading; its writers deliver the history that they still hold.
    pub fn subscriber<T: Topic>(&mut self) -> Result<Subscriber<T>, Error> {
        self.ports.subscriber(&mut self.membership)
    }

    /// Refuses where there is no memory for a file in the run folder that is about to be opened.
    pub fn reserve(&self, path: &Path, bytes: usize) -> Result<(), Error> {
        self.budget.require_file(path, bytes)
    }

    /// The loop begins: publishes that at once.
    pub fn running(&mut self) -> Result<(), Error> {
        self.status.state = StageState::Running;
        // Also of those to which the others' ports will write on this process's account.
        take_tables(&self.membership.domain)?;
        self.membership.end_start();
        self.publish_health()
    }

    /// Sets what is wrong; an empty text says that nothing is. `lost`: data lost in the stage
    /// itself.
    pub fn set_status(&mut self, message: &str, lost: u64) {
        if self.status.set(message, lost) {
            self.log(Priority::Warning, message);
        }
    }

    /// Sets what people may want to know while all is well: not for the journal. What
    /// [`Self::set_status`] has set stays.
    pub fn set_remark(&mut self, message: &str) {
        self.status.set_remark(message);
    }

    /// Something that `systemctl status` shall show beside rate and age, such as "trust good".
    pub fn set_status_note(&mut self, note: &str) {
        note.clone_into(&mut self.supervision.note);
    }

    /// There is nothing more to do, but what was sent last stays in reach.
    pub fn finished(&mut self) -> Result<(), Error> {
        self.status.state = StageState::Finished;
        self.publish_health()
    }

    /// Writes a line to the journal.
    pub fn log_info(&self, text: &str) {
        self.log(Priority::Info, text);
    }

    fn log(&self, priority: Priority, text: &str) {
        let last = self.ports.last_message(self.epoch());
        self.supervision.journal.log(priority, last, text);
    }

    /// Sleeps until one of `on` has something, a reader has joined, or the time is over. Health
    /// and the watchdog's signal go out meanwhile: a loop that does not come here any more hangs.
    /// Fails with [`Error::MemoryGone`] where the memory that it shares was removed or cut.
    pub fn wait(
        &mut self,
        on: &[&dyn Waitable],
        timeout: Option<Duration>,
    ) -> Result<WakeReason, Error> {
        let end = timeout.map(|timeout| Instant::now() + timeout);
        loop {
            self.ports.bus.exhausted.check()?;
            match self.supervision.take_request() {
                Some(Request::Stop) => return Ok(WakeReason::Stop),
                Some(Request::Reload) if self.reload() => return Ok(WakeReason::Event),
                _ => {}
            }
            let now_ns = self.clock().now_ns();
            if self.status.is_due(now_ns) {
                // First: publishing writes to that memory.
                let (name, presence) = (self.membership.name(), &self.membership.presence);
                self.memory_watch.check(name, presence, &self.ports.bus)?;
                self.publish_health()?;
            }
            let watchdog_ns = self.supervision.notify.feed_watchdog(now_ns);
            let next_ns = watchdog_ns.min(self.status.next_publish_ns);
            let to_next = next_ns.saturating_sub(now_ns).max(0);
            let mut pause = Duration::from_nanos(to_next.unsigned_abs());
            if let Some(end) = end {
                pause = pause.min(end.saturating_duration_since(Instant::now()));
            }
            let outcome = self.sleep(on, pause)?;
            if outcome.stop {
                return Ok(WakeReason::Stop);
            }
            if outcome.events {
                return Ok(WakeReason::Event);
            }
            if end.is_some_and(|end| Instant::now() >= end) {
                return Ok(WakeReason::Timeout);
            }
        }
    }

    fn sleep(&self, on: &[&dyn Waitable], pause: Duration) -> Result<WaitOutcome, Error> {
        let requests = self.supervision.descriptor()?;
        let requests = requests.iter().map(|requests| requests as &dyn Waitable);
        let on: Vec<&dyn Waitable> = on.iter().copied().chain(requests).collect();
        self.ports.sleep(&on, pause)
    }

    /// Reads the configuration again; returns whether the stage has to take one over. An error in
    /// a file is logged, and the configuration in force stays.
    fn reload(&mut self) -> bool {
        match self.supervision.read_configuration(self.membership.name()) {
            Ok(messages) => {
                self.log_info("the configuration was read again");
                messages.iter().for_each(|text| self.log_info(text));
            }
            Err(error) => self.log(
                Priority::Error,
                &format!("the configuration stays as it was: {error}"),
            ),
        }
        // Ready again when the loop comes back.
        self.status.publish_at_once();
        self.supervision.has_changed()
    }

    /// Publishes health now.
    fn publish_health(&mut self) -> Result<(), Error> {
        let now_ns = self.clock().now_ns();
        let ports = self.ports.health();
        let (status, entry) = (&mut self.status, self.membership.registry.entry());
        let head = status.health(now_ns, entry, &ports);
        self.supervision.publish_status(now_ns, status, &ports);
        self.ports.publish_health(MessageRef {
            head: &head,
            items: &[],
        })
    }

    /// Leaves the pipeline. Readers that are just being replaced get a moment to take what was
    /// sent last.
    pub fn close(mut self) -> Result<(), Error> {
        self.status.state = StageState::Stopping;
        self.publish_health()?;
        std::thread::sleep(PARTING);
        self.membership.registry.end()
    }
}

/// Radars that see farther than this send scans like a Navtech's, others like an iSDR-C's.
const LONG_RANGE_M: f64 = 50.0;

/// Readers wake within a tenth of a millisecond; this is a hundred times that.
const PARTING: Duration = Duration::from_millis(10);

//! The node of a process, and services that are opened with retries.

use super::exhausted::Exhausted;
use super::resource::{BusResource, MemoryLoss};
use super::{qos, wire::Wire};
use crate::{Domain, Error, Registry, dead_node_cleanup::free_slots};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileName, LogLevel, Node, NodeBuilder, NodeName, Path, SemanticString, ServiceName,
    ipc, set_log_level,
};
use iceoryx2::service::port_factory::{event, publish_subscribe};
use randt_messages::Topic;
use std::time::Duration;

/// iceoryx2 waits this long for what another process is making; none is while this process starts.
const CREATION_TIMEOUT: Duration = Duration::from_millis(50);
/// Attempts to open something, and the pause between them: what others are clearing away takes
/// milliseconds.
const ATTEMPTS: u32 = 10;
const PAUSE: Duration = Duration::from_millis(20);
/// Event services have room for every stage and tool, and for those that were killed while they
/// started.
const EVENT_PORTS: usize = 32;
/// Nodes that may have a service open at once.
const NODES: usize = 32;

/// Publisher side of a topic.
pub(crate) type Service<T> = publish_subscribe::PortFactory<ipc::Service, [u8], Wire<T>>;

/// A node of iceoryx2 in a domain.
#[derive(Debug)]
pub(crate) struct Bus {
    node: BusResource<Node<ipc::Service>>,
    /// Whether the memory of this node's resources is lost: they are not released then.
    pub(crate) memory_loss: MemoryLoss,
    /// The domain that it is in.
    pub(crate) domain: Domain,
    name: String,
    /// Whether a port could not connect because this process has run out of something.
    pub(crate) exhausted: Exhausted,
}

/// iceoryx2's configuration in a domain; its own configuration files are not read.
pub(crate) fn configuration(domain: &Domain) -> Result<Config, Error> {
    let mut config = Config::default();
    let root = domain.root();
    let root_path = Path::new(root.as_os_str().as_encoded_bytes())
        .map_err(|cause| Error::bus(format!("{}: as a path", root.display()), cause))?;
    config.global.set_root_path(&root_path);
    let prefix = domain.segment_prefix();
    config.global.prefix = FileName::new(prefix.as_bytes())
        .map_err(|cause| Error::bus(format!("{prefix}: as a prefix"), cause))?;
    config.global.creation_timeout = CREATION_TIMEOUT;
    // It forgets the slots of a node whose clean-up was cut short; `dead_node_cleanup` does not.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

impl Bus {
    /// Makes the node. Call it under the lock of those who start, after what dead processes have
    /// left is cleared away.
    pub(crate) fn open(domain: &Domain, name: &str) -> Result<Self, Error> {
        // Every failure comes back as an error, which is logged once.
        set_log_level(LogLevel::Fatal);
        let config = configuration(domain)?;
        let what = format!("node {name}");
        let node_name = NodeName::new(name).map_err(|cause| Error::bus(&what, cause))?;
        let create = || {
            let builder = NodeBuilder::new().name(&node_name).config(&config);
            builder.create::<ipc::Service>()
        };
        let node = retry(&what, || {}, create)?;
        let memory_loss = MemoryLoss::default();
        Ok(Self {
            node: memory_loss.guard(node),
            memory_loss,
            domain: domain.clone(),
            name: name.to_owned(),
            exhausted: Exhausted::default(),
        })
    }

    /// The node's id.
    pub(crate) fn node_id(&self) -> u128 {
        self.node.id().value()
    }

    /// Opens a topic, or makes it if this is the first process to open it.
    pub(crate) fn topic<T: Topic>(&self) -> Result<BusResource<Service<T>>, Error> {
        let topic = qos::topic::<T>();
        let name = service_name(T::NAME)?;
        let opened = self.retry(T::NAME, || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<[u8]>()
                .user_header::<Wire<T>>()
                .max_publishers(qos::WRITERS)
                .max_subscribers(topic.qos.readers)
                .max_nodes(NODES)
                .subscriber_max_buffer_size(topic.qos.buffer)
                .subscriber_max_borrowed_samples(qos::BORROWED)
                .history_size(topic.qos.history)
                .enable_safe_overflow(true)
                .open_or_create()
        });
        match opened {
            Ok(service) => Ok(self.memory_loss.guard(service)),
            Err(Error::Bus { cause, .. }) if cause.contains("Incompatible") => {
                Err(self.foreign_layout::<T>())
            }
            Err(error) => Err(error),
        }
    }

    /// The error that names the processes with another layout of a topic.
    fn foreign_layout<T: Topic>(&self) -> Error {
        let holders: Vec<_> = Registry::all(&self.domain)
            .into_iter()
            .filter(|(entry, lives)| *lives && entry.name != self.name)
            .filter_map(|(entry, _)| {
                let theirs = entry.topics.get(T::NAME)?.clone();
                (theirs != T::TYPE_NAME).then_some((entry, theirs))
            })
            .collect();
        let names = holders
            .iter()
            .map(|(entry, _)| format!("randt-{} (process {})", entry.name, entry.pid))
            .reduce(|names, name| format!("{names} and {name}"));
        let unknown =
            "a process that is not in the register (perhaps a randt top of another build)";
        let theirs = holders.first().map_or("another one", |(_, theirs)| theirs);
        Error::Layout {
            topic: T::NAME,
            ours: T::TYPE_NAME,
            theirs: theirs.to_owned(),
            holder: names.clone().unwrap_or_else(|| unknown.to_owned()),
            restart: names.unwrap_or_else(|| "all stages".to_owned()),
        }
    }

    /// Wakes the processes that listen to a name.
    pub(crate) fn notifier(
        &self,
        name: &str,
    ) -> Result<BusResource<Notifier<ipc::Service>>, Error> {
        let service = self.event(name)?;
        let notifier = self.retry(name, || service.notifier_builder().create())?;
        Ok(self.memory_loss.guard(notifier))
    }

    /// Is woken by the processes that notify a name.
    pub(crate) fn listener(
        &self,
        name: &str,
    ) -> Result<BusResource<Listener<ipc::Service>>, Error> {
        let service = self.event(name)?;
        let listener = self.retry(name, || service.listener_builder().create())?;
        Ok(self.memory_loss.guard(listener))
    }

    fn event(&self, name: &str) -> Result<event::PortFactory<ipc::Service>, Error> {
        let service = service_name(name)?;
        self.retry(name, || {
            self.node
                .service_builder(&service)
                .event()
                .max_notifiers(EVENT_PORTS)
                .max_listeners(EVENT_PORTS)
                .max_nodes(NODES)
                .open_or_create()
        })
    }

    /// Tries until it succeeds or the attempts are over; between two attempts the slots that no
    /// living node holds are freed.
    pub(crate) fn retry<R, E: std::fmt::Debug>(
        &self,
        name: &str,
        attempt: impl FnMut() -> Result<R, E>,
    ) -> Result<R, Error> {
        let clear = || {
            // Where nothing could be freed the next attempt fails as this one did.
            let _ = free_slots(&self.domain, Some(self.node_id()));
        };
        retry(name, clear, attempt)
    }
}

fn retry<R, E: std::fmt::Debug>(
    what: &str,
    clear: impl Fn(),
    mut attempt: impl FnMut() -> Result<R, E>,
) -> Result<R, Error> {
    let mut failed = 0;
    loop {
        match attempt() {
            Ok(made) => return Ok(made),
            Err(cause) if failed + 1 == ATTEMPTS => return Err(Error::bus(what, cause)),
            Err(_) => failed += 1,
        }
        clear();
        std::thread::sleep(PAUSE);
    }
}

fn service_name(name: &str) -> Result<ServiceName, Error> {
    ServiceName::new(name).map_err(|cause| Error::bus(format!("service {name}"), cause))
}

//! The node among ROS 2's: its topics, its services, and its entry in the graph.

use crate::bell::Bell;
use crate::loopback;
use crate::names;
use crate::participant::{Described, Participant, Quality, Reader, Writer};
use crate::service::{Request, Service};
use crate::subscription::Subscription;
use randt::ros_topics::{LIVE_TOPICS, Topic};
use randt_device::Backoff;
use randt_ros_messages::{CLOUD, Gid, TRANSFORMS, participant_entities};
use randt_stage::{Descriptor, Error};
use rustdds::dds::result::CreateError;
use std::collections::BTreeMap;
use std::net::{IpAddr, UdpSocket};
use std::time::SystemTime;

/// Where it takes part, and under which names.
#[derive(Clone, Debug)]
pub struct NodeOptions {
    /// ROS's domain.
    pub domain: u16,
    /// Addresses of this machine in whose networks it takes part; empty: in all.
    pub networks: Vec<IpAddr>,
    /// Stands before all names; empty, or with a slash at its beginning.
    pub namespace: String,
    /// 24 up to Humble, 16 since.
    pub gid_bytes: usize,
}

/// The node, or the wait for its network.
pub struct Node {
    options: NodeOptions,
    name: String,
    /// Topics to subscribe to, and services to offer.
    topics: Vec<String>,
    services: Vec<String>,
    bell: Bell,
    open: Option<Open>,
    backoff: Backoff,
    wall: SystemTime,
    /// What who subscribes late must get: kept for a participant that comes after this one.
    latched: BTreeMap<&'static str, Vec<u8>>,
    /// Messages that could not be sent.
    unsent: u64,
    /// Messages that are no CDR.
    undecoded: u64,
    /// Why it is not among the others.
    problem: Option<String>,
}

/// All that is open. Fields are dropped from above, the participant last.
struct Open {
    writers: BTreeMap<&'static str, Writer>,
    subscriptions: Vec<Subscription>,
    services: Vec<Service>,
    graph: Writer,
    participant: Participant,
}

/// A message that has come.
pub struct Received {
    pub topic: String,
    pub type_name: String,
    /// As CDR.
    pub message: Vec<u8>,
}

impl Node {
    /// A node that subscribes to topics and offers services; both names as ROS has them, the
    /// services' without the namespace.
    pub fn new(
        options: NodeOptions,
        name: &str,
        topics: Vec<String>,
        services: &[&str],
    ) -> std::io::Result<Self> {
        Ok(Self {
            name: name.replace(|c: char| !c.is_ascii_alphanumeric(), "_"),
            topics,
            services: services.iter().map(|it| (*it).to_owned()).collect(),
            bell: Bell::new()?,
            open: None,
            backoff: Backoff::default(),
            wall: SystemTime::now(),
            latched: BTreeMap::new(),
            unsent: 0,
            undecoded: 0,
            problem: None,
            options,
        })
    }

    /// Joins where it has not, and follows what others offer.
    pub fn tend(&mut self, now_ns: i64) {
        let wall = SystemTime::now();
        if wall < self.wall {
            // RustDDS orders what comes by this clock: until it is as late again nothing would.
            self.open = None;
        }
        self.wall = wall;
        if self.open.is_none() {
            if !self.backoff.is_due(now_ns) {
                return;
            }
            if let Err(error) = self.join() {
                self.backoff.failed(now_ns);
                self.problem = Some(error);
                return;
            }
            self.backoff.succeeded();
            self.problem = None;
        }
        if let Err(error) = self.follow() {
            self.open = None;
            self.problem = Some(error.to_string());
        }
    }

    fn join(&mut self) -> Result<(), String> {
        for address in &self.options.networks {
            // One that is not there would be left out in silence.
            UdpSocket::bind((*address, 0)).map_err(|error| format!("{address}: {error}"))?;
        }
        let open = self.open_all().map_err(|error| {
            let domain = self.options.domain;
            format!("no place in ROS 2's domain {domain}: {error}")
        })?;
        for (name, message) in &self.latched {
            if let Some(writer) = open.writers.get(name) {
                writer.write(message.clone(), None);
            }
        }
        self.open = Some(open);
        self.publish_graph();
        Ok(())
    }

    fn open_all(&self) -> Result<Open, CreateError> {
        let networks = Some(self.options.networks.as_slice()).filter(|all| !all.is_empty());
        let participant = Participant::join(self.options.domain, networks)?;
        if self.options.networks.iter().all(IpAddr::is_loopback) && networks.is_some() {
            loopback::keep()?;
        }
        let mut writers = BTreeMap::new();
        for (topic, name) in LIVE_TOPICS {
            let writer = participant.writer(&Described {
                name: &names::topic(&self.full(name)),
                type_name: &names::message_type(topic.kind.package, topic.kind.name),
                quality: quality(&topic),
            })?;
            writers.insert(name, writer);
        }
        let services = self.services.iter();
        let services =
            services.map(|name| Service::open(&participant, &self.full(name), &self.bell));
        let subscriptions = self.topics.iter().cloned().map(Subscription::new);
        Ok(Open {
            services: services.collect::<Result<_, _>>()?,
            subscriptions: subscriptions.collect(),
            graph: participant.writer(&Described {
                name: "ros_discovery_info",
                type_name: "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
                quality: LATCHED,
            })?,
            writers,
            participant,
        })
    }

    /// A name with the namespace before it.
    fn full(&self, name: &str) -> String {
        format!("{}{name}", self.options.namespace)
    }

    fn follow(&mut self) -> Result<(), CreateError> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        if !open.participant.has_news() {
            return Ok(());
        }
        let offers = open.participant.offers();
        let mut is_other = false;
        for subscription in &mut open.subscriptions {
            is_other |= subscription.follow(&open.participant, &offers, &self.bell)?;
        }
        if is_other {
            self.publish_graph();
        }
        Ok(())
    }

    /// Says whose the topics are.
    fn publish_graph(&self) {
        let Some(open) = &self.open else {
            return;
        };
        let subscribed = open.subscriptions.iter().filter_map(Subscription::reader);
        let asked = open.services.iter().map(|service| &service.requests);
        let readers: Vec<Gid> = subscribed.chain(asked).map(Reader::gid).collect();
        let replied = open.services.iter().map(|service| &service.replies);
        let writers: Vec<Gid> = open
            .writers
            .values()
            .chain(replied)
            .map(Writer::gid)
            .collect();
        let namespace = match self.options.namespace.as_str() {
            "" => "/",
            other => other,
        };
        open.graph.write(
            participant_entities(
                self.options.gid_bytes,
                &open.participant.gid(),
                [namespace, &self.name],
                &readers,
                &writers,
            ),
            None,
        );
    }

    /// What to wait for.
    pub fn descriptor(&self) -> Result<Descriptor<'_>, Error> {
        Descriptor::new(self.bell.descriptor())
    }

    /// The messages that have come, in the order in which they came on each topic.
    pub fn received(&mut self) -> std::io::Result<Vec<Received>> {
        self.bell.hush()?;
        let mut received = Vec::new();
        let Some(open) = &self.open else {
            return Ok(received);
        };
        for subscription in &open.subscriptions {
            subscription.take(|taken| match taken {
                Ok((sample, type_name)) => received.push(Received {
                    topic: subscription.topic().to_owned(),
                    type_name,
                    message: sample.message,
                }),
                Err(_) => self.undecoded += 1,
            });
        }
        Ok(received)
    }

    /// The requests that have come, with the service's index among all.
    pub fn requests(&self) -> Vec<(usize, Request)> {
        let mut requests = Vec::new();
        let services = self.open.iter().flat_map(|open| &open.services);
        for (index, service) in services.enumerate() {
            service.take(|request| requests.push((index, request)));
        }
        requests
    }

    /// Answers a request of the service with that index.
    pub fn reply(&self, index: usize, request: &Request, success: bool, message: &str) {
        let service = self.open.as_ref().and_then(|open| open.services.get(index));
        if let Some(service) = service {
            service.reply(request, success, message);
        }
    }

    /// What is wrong, the worst first.
    pub fn problem(&self) -> Option<String> {
        let unsent = (self.unsent > 0).then(|| "a node of ROS does not take all".to_owned());
        let undecoded = (self.undecoded > 0).then(|| "messages came that are no CDR".to_owned());
        self.problem.clone().or(undecoded).or(unsent)
    }

    /// Messages that were lost.
    pub fn lost(&self) -> u64 {
        self.unsent + self.undecoded
    }

    /// Publishes a message of one of [`LIVE_TOPICS`].
    pub fn send(&mut self, topic: &Topic, name: &'static str, message: Vec<u8>) {
        let writer = self.open.as_ref().and_then(|open| open.writers.get(name));
        if topic.is_latched {
            self.latched.insert(name, message.clone());
        }
        // Without a participant nobody misses it.
        if writer.is_some_and(|writer| !writer.write(message, None)) {
            self.unsent += 1;
        }
    }
}

const LATCHED: Quality = Quality {
    is_reliable: true,
    is_kept: true,
    depth: 1,
};

/// What tf2, nav2 and rviz2 ask for, or less. All is reliable: who asks for best effort, as for
/// sensor data, gets that of a reliable topic, and who asks for a reliable one, as rviz2 does, gets
/// nothing of the other.
fn quality(topic: &Topic) -> Quality {
    let depth = match topic.kind {
        _ if topic.is_latched => return LATCHED,
        CLOUD => 5,
        TRANSFORMS => 100,
        _ => 10,
    };
    Quality {
        is_reliable: true,
        is_kept: false,
        depth,
    }
}

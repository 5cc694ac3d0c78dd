//! The slots of the bus's services and their holders, read from the bytes of the services'
//! segments.
//!
//! iceoryx2 lists a service's ports only to a process that opens the service, which takes a slot
//! itself, and never names a node whose files are gone. So the segments are read as files, as
//! iceoryx2 0.10.0 lays them out. A test compares what is read with what iceoryx2 lists; a segment
//! that another version made is damaged to this build, as it is to iceoryx2.

use crate::Domain;
use crate::domain::{SHARED_MEMORY, user};
use iceoryx2::service::dynamic_config::{
    event::{ListenerDetails, NotifierDetails},
    publish_subscribe::{PublisherDetails, SubscriberDetails},
};
use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::mem::offset_of;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The version that a whole segment begins with: major, minor and patch, 16 bits each.
pub(crate) const VERSION: u64 = 10 << 16;
/// Where the number of the messaging pattern is, and what it is for topics and for notices.
const PATTERN: usize = 8;
const TOPIC: u32 = 1;
const NOTICES: u32 = 2;
/// Where the tables of a segment begin: both kinds of ports, then the nodes.
const FIRST_PORTS: usize = 16;
const SECOND_PORTS: usize = 96;
const NODES: usize = 184;
/// In a table: distances from each field to what it points at, and counters.
const GENERATIONS: usize = 0;
const ENTRIES: usize = 8;
const CAPACITY: usize = 16;
const OWNERS: usize = 48;
const LOCK: usize = 72;
/// No table has more slots.
const CAPACITY_MAX: u64 = 1024;
/// Owner of a free slot; also the counter of a table that takes no entries any more.
const NO_OWNER: u64 = u64::MAX;

/// Names that iceoryx2 gives to a service's files.
const DEFINITION: &str = "service";
const SEGMENT: &str = "dynamic";

/// A slot of a service's dynamic configuration that is taken: by a port, or by a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ServiceSlot {
    /// The node's owner number: process and counter, the upper half of its id.
    pub owner: u64,
    /// The node's whole id; none if its process was killed before it had written it.
    pub node: Option<u128>,
    /// The port, if the slot is a port's and written.
    pub port: Option<u128>,
}

/// A service as it is found on disk and in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Service {
    /// The hash of its name and pattern, as iceoryx2 writes it.
    pub hash: String,
    /// Its name, for people.
    pub name: String,
    /// The file that defines it.
    pub definition: PathBuf,
    /// Its segment; none if no segment has the number of the definition.
    pub segment: Option<PathBuf>,
}

/// All services of a domain that are made.
pub(crate) fn services(domain: &Domain) -> Vec<Service> {
    let segments = segments(domain);
    let definitions = domain.files_in(&domain.root().join("services"));
    let mut services: Vec<Service> = definitions
        .filter_map(|definition| {
            let (hash, kind) = domain.name_parts(&definition)?;
            let hash = hash.to_owned();
            let text = fs::read_to_string(&definition).ok()?;
            (kind == DEFINITION).then(|| Service {
                name: service_name(&text).unwrap_or(&hash).to_owned(),
                hash,
                segment: service_id(&text).and_then(|id| segments.get(&id).cloned()),
                definition,
            })
        })
        .collect();
    services.sort_by(|a, b| a.hash.cmp(&b.hash));
    services
}

/// Segments of services by the services' numbers, the last part of their names. Any user can make
/// files of such names in /dev/shm: those of other users are ignored.
pub(crate) fn segments(domain: &Domain) -> BTreeMap<u128, PathBuf> {
    let is_own = |path: &PathBuf| fs::symlink_metadata(path).is_ok_and(|found| is_own_file(&found));
    let number = |path: &Path| {
        let (stem, kind) = domain.name_parts(path)?;
        let (_, number) = stem.rsplit_once('_')?;
        (kind == SEGMENT).then(|| number.parse().ok())?
    };
    let own = domain.files_in(Path::new(SHARED_MEMORY)).filter(is_own);
    own.filter_map(|path| Some((number(&path)?, path)))
        .collect()
}

/// Whether a file is plain and this user's.
pub(crate) fn is_own_file(found: &Metadata) -> bool {
    found.is_file() && found.uid() == user()
}

/// The name that a definition gives to its service.
fn service_name(definition: &str) -> Option<&str> {
    let mut lines = definition.lines().filter_map(|line| line.split_once('='));
    let (_, name) = lines.find(|(key, _)| key.trim() == "service_name")?;
    Some(name.trim().trim_matches('"'))
}

/// The number that a definition gives to its service.
fn service_id(definition: &str) -> Option<u128> {
    let (_, section) = definition.split_once("[unique_service_id]")?;
    let value = |name: &str| {
        let mut lines = section.lines().filter_map(|line| line.split_once('='));
        let (_, value) = lines.find(|(key, _)| key.trim() == name)?;
        value.trim().parse::<u64>().ok()
    };
    let (upper, lower) = (value("unique_value")?, value("payload_value")?);
    Some(u128::from(upper) << 64 | u128::from(lower))
}

impl Service {
    /// The slots that are taken now; none where no process can join: the last one has left and has
    /// not removed the service, or it is cut, gone, half made or of another version.
    pub(crate) fn slots(&self) -> Option<Vec<ServiceSlot>> {
        slots(&fs::read(self.segment.as_ref()?).ok()?)
    }
}

/// The layout of a table's entries, bytes.
#[derive(Clone, Copy)]
struct EntryLayout {
    size: usize,
    node_at: usize,
    port_at: Option<usize>,
}

/// That of ports.
macro_rules! entry_layout {
    ($details:ident, $port_id:ident) => {
        EntryLayout {
            size: size_of::<$details>(),
            node_at: offset_of!($details, node_id),
            port_at: Some(offset_of!($details, $port_id)),
        }
    };
}

/// The slots in the bytes of a segment; none if they are no whole segment, or it is closed.
fn slots(bytes: &[u8]) -> Option<Vec<ServiceSlot>> {
    if word(bytes, 0)? != VERSION {
        return None;
    }
    let [first, second] = match word(bytes, PATTERN)? as u32 {
        TOPIC => [
            entry_layout!(SubscriberDetails, subscriber_id),
            entry_layout!(PublisherDetails, publisher_id),
        ],
        NOTICES => [
            entry_layout!(ListenerDetails, listener_id),
            entry_layout!(NotifierDetails, notifier_id),
        ],
        _ => return None,
    };
    let nodes = EntryLayout {
        size: size_of::<u128>(),
        node_at: 0,
        port_at: None,
    };
    let tables = [(FIRST_PORTS, first), (SECOND_PORTS, second), (NODES, nodes)];
    let mut found = Vec::new();
    for (at, entry) in tables {
        read_table(bytes, at, entry, &mut found)?;
    }
    (word(bytes, NODES + LOCK)? != NO_OWNER).then_some(found)
}

/// Adds the taken slots of a table.
fn read_table(
    bytes: &[u8],
    table: usize,
    entry: EntryLayout,
    found: &mut Vec<ServiceSlot>,
) -> Option<()> {
    let capacity = word(bytes, table + CAPACITY)?;
    if capacity > CAPACITY_MAX {
        return None;
    }
    let pointed_at = |field: usize| {
        let distance = usize::try_from(word(bytes, table + field)?).ok()?;
        (table + field).checked_add(distance)
    };
    let (generations, entries) = (pointed_at(GENERATIONS)?, pointed_at(ENTRIES)?);
    let owners = pointed_at(OWNERS)?;
    // A table that is cut short is damaged, whether the missing slots are taken or not.
    bytes.get(..entries + capacity as usize * entry.size)?;
    for slot in 0..capacity as usize {
        let owner = word(bytes, owners + slot * size_of::<u64>())?;
        if owner == NO_OWNER {
            continue;
        }
        // An entry is written when its generation is odd.
        let is_written = word(bytes, generations + slot * size_of::<u64>())? % 2 == 1;
        let at = entries + slot * entry.size;
        let node = is_written.then(|| id(bytes, at + entry.node_at)).flatten();
        let port = entry.port_at.filter(|_| is_written);
        found.push(ServiceSlot {
            owner,
            // What is there may be the previous owner's.
            node: node.filter(|node| owner_of(*node) == owner),
            port: port.and_then(|port_at| id(bytes, at + port_at)),
        });
    }
    Some(())
}

/// The owner number of a node.
pub(crate) fn owner_of(node: u128) -> u64 {
    (node >> 64) as u64
}

fn id(bytes: &[u8], at: usize) -> Option<u128> {
    let (lower, upper) = (word(bytes, at)?, word(bytes, at + size_of::<u64>())?);
    Some(u128::from(upper) << 64 | u128::from(lower))
}

fn word(bytes: &[u8], at: usize) -> Option<u64> {
    let word = bytes.get(at..at.checked_add(size_of::<u64>())?)?;
    Some(u64::from_le_bytes(word.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ports::Bus;
    use randt_messages::{ImuSampleTopic, Topic};

    fn service(domain: &Domain, name: &str) -> Vec<Service> {
        let all = services(domain).into_iter();
        all.filter(|service| service.name == name).collect()
    }

    fn open(service: &Service) -> Vec<ServiceSlot> {
        service.slots().unwrap()
    }

    #[test]
    fn what_is_read_is_what_iceoryx2_lists() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("slots", Some(run.path())).unwrap();
        domain.make().unwrap();
        let bus = Bus::open(&domain, "test").unwrap();
        let topic = bus.topic::<ImuSampleTopic>().unwrap();
        let node = bus.node_id();
        let slot = |port| ServiceSlot {
            owner: owner_of(node),
            node: Some(node),
            port,
        };
        let found = service(&domain, ImuSampleTopic::NAME);
        assert_eq!(found.len(), 1, "one topic, without notices");
        assert_eq!(open(&found[0]), [slot(None)]);
        let reader = topic.subscriber_builder().create().unwrap();
        let writer = topic.publisher_builder().create().unwrap();
        let [reads, writes] = [reader.id().value(), writer.id().value()].map(Some);
        assert_eq!(open(&found[0]), [slot(reads), slot(writes), slot(None)]);
        drop(reader);
        assert_eq!(open(&found[0]), [slot(writes), slot(None)]);

        let listener = bus.listener("test/notices").unwrap();
        let notices = &service(&domain, "test/notices")[0];
        let listener_id = Some(listener.id().value());
        assert_eq!(open(notices), [slot(listener_id), slot(None)]);
        let notifier = bus.notifier("test/notices").unwrap();
        let notifier_id = Some(notifier.id().value());
        assert_eq!(
            open(notices),
            [slot(listener_id), slot(notifier_id), slot(None)]
        );

        // A segment that is cut or of another version is recognized.
        let mut bytes = fs::read(notices.segment.as_ref().unwrap()).unwrap();
        for length in (0..bytes.len() - 64).step_by(61) {
            assert_eq!(slots(&bytes[..length]), None, "{length} bytes");
        }
        bytes[0] ^= 1;
        assert_eq!(slots(&bytes), None);
        drop((writer, topic, listener, notifier));
        assert_eq!(services(&domain), []);
    }
}

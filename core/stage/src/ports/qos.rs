//! The topics' quality of service and what they cost in shared memory.

use randt_messages::{BUS_TOPICS, BusTopic, Header, Topic, TopicQos};

/// Writers that a topic has room for though it has one: a writer killed while it started may keep
/// its slot until the last stage has left. One in a hundred such kills leaves one; with 4 slots a
/// stage never came back after some 200.
pub(crate) const WRITERS: usize = 16;
/// Messages that a reader may hold at once, and that a writer may have begun.
pub(crate) const BORROWED: usize = 2;
pub(crate) const LOANED: usize = 1;

/// A topic as the bus carries it; one that is not registered (a test's) gets a modest quality of
/// service.
pub(crate) fn topic<T: Topic>() -> BusTopic {
    let known = BUS_TOPICS.iter().find(|topic| topic.name == T::NAME);
    known.map_or_else(
        || BusTopic::new::<T>(TopicQos::UNREGISTERED),
        |known| *known,
    )
}

/// Messages that a writer has memory for: its history, and what every reader may hold or have
/// waiting.
fn slots(qos: &TopicQos) -> usize {
    qos.readers * (qos.buffer + BORROWED) + qos.history + LOANED
}

/// Most messages that are alive at once: the newest ones wait for every reader that is behind, and
/// each reader holds some older ones.
pub(crate) fn living(qos: &TopicQos) -> usize {
    qos.history.max(qos.buffer) + BORROWED * qos.readers + LOANED
}

/// Most bytes of a message's items.
pub(crate) fn items_bytes_max(topic: &BusTopic) -> usize {
    topic.max_items * topic.item_bytes
}

/// Bytes of the items as they usually are. `is_long_range`: of a Navtech's scans.
pub(crate) fn items_bytes_usual(topic: &BusTopic, is_long_range: bool) -> usize {
    let [isdr_c, navtech] = topic.qos.usual_items;
    topic.item_bytes * if is_long_range { navtech } else { isdr_c }
}

/// Shared memory that a writer of a topic takes, bytes. `is_long_range`: of a Navtech's scans.
/// Memory that is reserved for larger messages costs nothing until they come.
pub fn bytes_in_use(topic: &BusTopic, is_long_range: bool) -> usize {
    let usual = topic.head_bytes + items_bytes_usual(topic, is_long_range) + OVERHEAD;
    // Where messages lie apart, each has pages of its own.
    let apart = items_bytes_max(topic) > PAGE;
    let pages = if apart { PAGE } else { 0 };
    living(&topic.qos) * (usual + pages) + slots(&topic.qos) * SLOT
}

/// What a topic costs, in a line for people.
pub(crate) fn budget(topic: &BusTopic, is_long_range: bool) -> String {
    format!(
        "{}: {:.2} MB in use, buffer {} / history {}, messages up to {:.1} kB",
        topic.name,
        bytes_in_use(topic, is_long_range) as f64 * 1e-6,
        topic.qos.buffer,
        topic.qos.history,
        (topic.head_bytes + items_bytes_max(topic)) as f64 * 1e-3,
    )
}

/// Memory is taken in pages, bytes.
const PAGE: usize = 4096;
/// iceoryx2's own header of a message, and alignment.
const OVERHEAD: usize = 64;
/// iceoryx2's lists have an entry for every slot, in use or not.
const SLOT: usize = 8;

// Every head begins with a header, so that ports can number messages without knowing them.
const _: () = assert!(size_of::<Header>() == 32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_topics_fit_the_budget() {
        let total = |is_long_range| {
            let bytes = BUS_TOPICS
                .iter()
                .map(|topic| bytes_in_use(topic, is_long_range));
            bytes.sum::<usize>()
        };
        assert!(total(false) < 64_000_000, "{}", total(false));
        assert!(total(true) < 128_000_000, "{}", total(true));
    }
}

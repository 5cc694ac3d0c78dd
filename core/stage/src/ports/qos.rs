//! The topics' quality of service and what they cost in shared memory.

use randt_messages::{BUS_TOPICS, BusTopic, Header, Topic, TopicQos};

/// Writers that a topic has room for though it has one: a writer killed while it started may keep
/// its slot until the last stage has left. One in a hundred such kills leaves one; with 4 slots a
/// stage never came back after some 200.
const WRITERS: usize = 16;
/// Messages that a reader may hold at once, and that a writer may have begun.
pub(crate) const BORROWED: usize = 2;
pub(crate) const LOANED: usize = 1;

/// How a topic is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Name.
    pub topic: &'static str,
    /// Name and layout of its messages in this build.
    pub type_name: &'static str,
    /// Messages that wait for a reader.
    pub buffer: usize,
    /// Messages that a reader gets at once when it joins.
    pub history: usize,
    /// Writers at once.
    pub writers: usize,
    /// Readers at once.
    pub readers: usize,
    /// Bytes of the head.
    pub head_bytes: usize,
    /// Most bytes of the items.
    pub items_bytes_max: usize,
    /// Bytes of the items as they usually are: iSDR-C, Navtech.
    pub items_bytes_usual: [usize; 2],
}

/// Every topic of the bus.
pub const TOPICS: &[Qos] = &{
    let mut topics = [Qos::new(&BUS_TOPICS[0]); BUS_TOPICS.len()];
    let mut i = 1;
    while i < topics.len() {
        topics[i] = Qos::new(&BUS_TOPICS[i]);
        i += 1;
    }
    topics
};

impl Qos {
    const fn new(topic: &BusTopic) -> Self {
        let [isdr_c, navtech] = topic.qos.usual_items;
        Self {
            topic: topic.name,
            type_name: topic.type_name,
            buffer: topic.qos.buffer,
            history: topic.qos.history,
            writers: WRITERS,
            readers: topic.qos.readers,
            head_bytes: topic.head_bytes,
            items_bytes_max: topic.max_items * topic.item_bytes,
            items_bytes_usual: [isdr_c * topic.item_bytes, navtech * topic.item_bytes],
        }
    }

    /// That of a topic; one that is not registered (a test's) gets a modest one.
    pub fn for_topic<T: Topic>() -> Self {
        let found = TOPICS.iter().find(|qos| qos.topic == T::NAME).copied();
        found.map_or_else(
            || Self::new(&BusTopic::new::<T>(TopicQos::UNREGISTERED)),
            |known| Self {
                type_name: T::TYPE_NAME,
                ..known
            },
        )
    }

    /// Messages that a writer has memory for: its history, and what every reader may hold or have
    /// waiting.
    pub fn slots(&self) -> usize {
        self.readers * (self.buffer + BORROWED) + self.history + LOANED
    }

    /// Most messages that are alive at once: the newest ones wait for every reader that is behind,
    /// and each reader holds some older ones.
    pub(crate) fn living(&self) -> usize {
        self.history.max(self.buffer) + BORROWED * self.readers + LOANED
    }

    /// Bytes of the items as they usually are. `is_long_range`: of a Navtech's scans.
    pub(crate) fn items_bytes_usual(&self, is_long_range: bool) -> usize {
        let [isdr_c, navtech] = self.items_bytes_usual;
        if is_long_range { navtech } else { isdr_c }
    }

    /// Shared memory that a writer takes, bytes. `is_long_range`: of a Navtech's scans. Memory
    /// that is reserved for larger messages costs nothing until they come.
    pub fn bytes_in_use(&self, is_long_range: bool) -> usize {
        let usual = self.head_bytes + self.items_bytes_usual(is_long_range) + OVERHEAD;
        // Where messages lie apart, each has pages of its own.
        let pages = if self.items_bytes_max > PAGE { PAGE } else { 0 };
        self.living() * (usual + pages) + self.slots() * SLOT
    }

    /// A line for people.
    pub fn budget(&self, is_long_range: bool) -> String {
        format!(
            "{}: {:.2} MB in use, buffer {} / history {}, messages up to {:.1} kB",
            self.topic,
            self.bytes_in_use(is_long_range) as f64 * 1e-6,
            self.buffer,
            self.history,
            (self.head_bytes + self.items_bytes_max) as f64 * 1e-3,
        )
    }
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
            let bytes = TOPICS.iter().map(|qos| qos.bytes_in_use(is_long_range));
            bytes.sum::<usize>()
        };
        assert!(total(false) < 64_000_000, "{}", total(false));
        assert!(total(true) < 128_000_000, "{}", total(true));
    }
}

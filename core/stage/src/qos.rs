//! The topics' quality of service and what they cost in shared memory: one table.

use randt_messages::{
    Header, ImuSampleTopic, Keyframe, MapperCorrection, MapperGraph, MapperGrid,
    OdometryStateTopic, RadarPoints, RadarScan, StageHealthTopic, Topic,
};

/// Readers that a topic has room for: its stage, recorder, view, supervisor and a person's tool or two.
const READERS: usize = 6;
/// The same of topics that every `randt top` reads: people's tools may never take the place of a stage that comes back.
const WATCHED: usize = 16;
/// Writers that a topic has room for though it has one: a writer killed while it started may keep its place until the
/// last stage has left. One in a hundred such kills leaves one; with 4 places a stage never came back after some 200.
const WRITERS: usize = 16;
/// Messages that a reader may hold at once, and that a writer may have begun.
pub(crate) const BORROWED: usize = 2;
pub(crate) const LOANED: usize = 1;

/// How a topic is carried.
///
/// Under safe overflow a late reader gets at most its own buffer of the history, so the two go together. A reader's
/// buffer lasts as long as a stage may be stopped, a writer's history as long as the recorder may be away: 5 s and more.
/// Under load the recorder's restart takes up to 2.3 s, and it may be killed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Name.
    pub topic: &'static str,
    /// Name and layout of its messages in this build.
    pub type_name: &'static str,
    /// Messages that wait for a reader.
    pub buffer: usize,
    /// Messages that a reader who joins gets at once.
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

/// Every topic.
pub const TOPICS: &[Qos] = &[
    // 6 s at 5 Hz; 10,000 returns of an iSDR-C, 30,000 of a Navtech above its floor.
    qos::<RadarScan>(32, 32, WRITERS, [10_000, 30_000]),
    // 8 s at 250 Hz.
    qos::<ImuSampleTopic>(2048, 2048, WRITERS, [0, 0]),
    qos::<RadarPoints>(32, 32, WRITERS, [2_500, 6_000]),
    watched(qos::<OdometryStateTopic>(32, 32, WRITERS, [0, 0])),
    // At most one a scan; the mapper gets older ones from the ring of keyframes.
    qos::<Keyframe>(64, 32, WRITERS, [2_500, 6_000]),
    // At most one a keyframe.
    watched(qos::<MapperCorrection>(32, 32, WRITERS, [0, 0])),
    // Twice a second, with each keyframe, and every 2 s the whole graph in pages.
    watched(qos::<MapperGraph>(64, 64, WRITERS, [300, 300])),
    // Tiles that have changed, every 2 s; as long as there are many, 160 a second.
    qos::<MapperGrid>(512, 512, WRITERS, [4096, 4096]),
    // Every stage and tool writes here, twice a second.
    watched(qos::<StageHealthTopic>(16, 16, 16, [0, 0])),
];

const fn qos<T: Topic>(buffer: usize, history: usize, writers: usize, items: [usize; 2]) -> Qos {
    let item = size_of::<T::Item>();
    Qos {
        topic: T::NAME,
        type_name: T::TYPE_NAME,
        buffer,
        history,
        writers,
        readers: READERS,
        head_bytes: size_of::<T::Head>(),
        items_bytes_max: T::MAX_ITEMS * item,
        items_bytes_usual: [items[0] * item, items[1] * item],
    }
}

const fn watched(qos: Qos) -> Qos {
    Qos {
        readers: WATCHED,
        ..qos
    }
}

impl Qos {
    /// The entry of a topic; one that is not in the table (a test's) gets a modest one.
    pub fn of<T: Topic>() -> Self {
        let found = TOPICS.iter().find(|qos| qos.topic == T::NAME).copied();
        found.map_or_else(
            || qos::<T>(16, 1, WRITERS, [0, 0]),
            |known| Self {
                type_name: T::TYPE_NAME,
                ..known
            },
        )
    }

    /// Messages that a writer has memory for: its history, and what every reader may hold or have waiting.
    pub fn slots(&self) -> usize {
        self.readers * (self.buffer + BORROWED) + self.history + LOANED
    }

    /// Most messages that are alive at once: the newest ones wait for every reader that is behind, and each reader holds
    /// some older ones.
    pub(crate) fn living(&self) -> usize {
        self.history.max(self.buffer) + BORROWED * self.readers + LOANED
    }

    /// Bytes of the items as they usually are. `navtech`: of a Navtech's scans.
    pub(crate) fn items_bytes_usual(&self, navtech: bool) -> usize {
        let [isdr_c, of_navtech] = self.items_bytes_usual;
        if navtech { of_navtech } else { isdr_c }
    }

    /// Shared memory that a writer takes, bytes. `navtech`: of a Navtech's scans. Memory that is reserved for larger
    /// messages costs nothing until they come.
    pub fn bytes_in_use(&self, navtech: bool) -> usize {
        let usual = self.head_bytes + self.items_bytes_usual(navtech) + OVERHEAD;
        // Where messages lie apart, each has pages of its own.
        let pages = if self.items_bytes_max > PAGE { PAGE } else { 0 };
        self.living() * (usual + pages) + self.slots() * SLOT
    }

    /// A line for people.
    pub fn budget(&self, navtech: bool) -> String {
        format!(
            "{}: {:.2} MB in use, buffer {} / history {}, messages up to {:.1} kB",
            self.topic,
            self.bytes_in_use(navtech) as f64 * 1e-6,
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
/// iceoryx2's lists have an entry for every place, in use or not.
const SLOT: usize = 8;

// Every head begins with a header, so that ports can number messages without knowing them.
const _: () = assert!(size_of::<Header>() == 32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_stands_once_and_all_fit_the_budget() {
        for (i, qos) in TOPICS.iter().enumerate() {
            assert!(TOPICS[i + 1..].iter().all(|other| other.topic != qos.topic));
            assert!(qos.history <= qos.buffer, "{}", qos.topic);
        }
        let total = |navtech| {
            TOPICS
                .iter()
                .map(|qos| qos.bytes_in_use(navtech))
                .sum::<usize>()
        };
        assert!(total(false) < 64_000_000, "{}", total(false));
        assert!(total(true) < 128_000_000, "{}", total(true));
    }

    /// Messages a second of a topic that carries a drive, at most.
    const RATES_HZ: [(&str, usize); 9] = [
        ("radar/scan/v1", 5),
        ("imu/sample/v1", 250),
        ("radar/points/v1", 5),
        ("odometry/state/v1", 5),
        ("odometry/keyframe/v1", 5),
        ("mapper/correction/v1", 5),
        // The beat, a message a keyframe, and a few pages every 2 s.
        ("mapper/graph/v1", 12),
        // The map of a drive changes by 200 tiles in 2 s at most.
        ("mapper/grid/v1", 100),
        ("stage/health/v1", 2),
    ];

    #[test]
    fn histories_outlast_a_recorder_that_is_away_for_five_seconds() {
        for qos in TOPICS {
            let (_, rate_hz) = RATES_HZ.iter().find(|(t, _)| *t == qos.topic).unwrap();
            let reach = qos.history.min(qos.buffer);
            assert!(reach >= 5 * rate_hz, "{}: {reach}", qos.topic);
        }
    }

    #[test]
    fn buffers_outlast_a_stage_that_is_stopped_for_five_seconds() {
        let buffer = |name| TOPICS.iter().find(|q| q.topic == name).unwrap().buffer;
        assert!(buffer("radar/scan/v1") > 5 * 5 && buffer("radar/points/v1") > 5 * 5);
        assert!(buffer("imu/sample/v1") > 5 * 250);
    }
}

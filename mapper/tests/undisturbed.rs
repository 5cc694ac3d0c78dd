//! A drive, what an undisturbed mapper makes of it, and its journals.

use crate::growth;
use randt_config::Config;
use randt_drives::{Drive, config};
use randt_mapper::occupancy::CellCount;
use randt_mapper::{
    ComponentIdx, KeyframeIdx, Known, LoopClosure, LoopStatus, Mapper, Restored, journal,
};
use randt_messages::{Keyframe, Message};
use randt_simulator::World;
use std::sync::LazyLock;

/// All that a mapper knows, bit by bit.
pub fn memory(mapper: &Mapper) -> Vec<u8> {
    let mut bytes = Vec::new();
    journal::append_snapshot(mapper, Known::default(), &mut bytes).unwrap();
    bytes
}

/// The map at the end: where everything stands, what was decided, and the grid.
#[derive(Debug, PartialEq)]
pub struct Map {
    poses: Vec<[u64; 3]>,
    components: Vec<ComponentIdx>,
    closures: Vec<LoopClosure>,
    pub accepted: Vec<LoopClosure>,
    grid: Vec<(i32, i32, Vec<CellCount>)>,
}

pub fn finished(mut mapper: Mapper) -> Map {
    mapper.finish();
    let tiles = mapper.grid().tiles();
    Map {
        poses: (mapper.poses().iter())
            .map(|pose| pose.to_array().map(f64::to_bits))
            .collect(),
        components: (0..mapper.keyframes().len())
            .map(|index| mapper.component_of(KeyframeIdx(index)))
            .collect(),
        closures: mapper.closures().to_vec(),
        accepted: mapper.accepted().copied().collect(),
        grid: tiles
            .map(|(index, tile)| (index.x, index.y, tile.cells().collect()))
            .collect(),
    }
}

/// A drive, what an undisturbed mapper made from the drive, and its journals.
pub struct Undisturbed {
    pub config: Config,
    pub keyframes: Vec<Message<Keyframe>>,
    /// Its memory after every keyframe.
    pub memories: Vec<Vec<u8>>,
    pub map: Map,
    /// The journal as the process writes it: a snapshot where one is due.
    pub journal: Vec<u8>,
    /// Where each keyframe's record begins in the journal; the end.
    pub starts: Vec<usize>,
}

impl Undisturbed {
    pub fn new(config: Config, keyframes: &[Message<Keyframe>]) -> Self {
        let mut mapper = Mapper::new(&config);
        let (mut memories, mut starts, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
        journal::begin(&config, &mut bytes);
        let (mut after_snapshot, mut known) = (0, Known::default());
        for (keyframes, keyframe) in (1..).zip(keyframes) {
            starts.push(bytes.len());
            journal::append_keyframe(keyframe.as_ref(), &mut bytes).unwrap();
            assert!(mapper.push(keyframe.as_ref()));
            memories.push(memory(&mapper));
            after_snapshot += 1;
            if journal::is_snapshot_due(keyframes, after_snapshot) {
                journal::append_snapshot(&mapper, known, &mut bytes).unwrap();
                known = mapper.known();
                after_snapshot = 0;
            }
        }
        starts.push(bytes.len());
        Self {
            config,
            keyframes: keyframes.to_vec(),
            memories,
            map: finished(mapper),
            journal: bytes,
            starts,
        }
    }

    /// The journal's header and keyframes alone.
    pub fn keyframes_only(&self, count: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        journal::begin(&self.config, &mut bytes);
        for keyframe in &self.keyframes[..count] {
            journal::append_keyframe(keyframe.as_ref(), &mut bytes).unwrap();
        }
        bytes
    }

    /// Restores from bytes that end after this many keyframes, and gives how.
    pub fn restored(&self, bytes: &[u8], count: usize) -> (Mapper, Restored) {
        let (mapper, restored) = Mapper::restore(&self.config, bytes).unwrap();
        assert_eq!(mapper.keyframes().len(), count);
        if count > 0 {
            let is_same = memory(&mapper) == self.memories[count - 1];
            assert!(is_same, "another memory after {count} keyframes");
        }
        (mapper, restored)
    }

    /// Drives on to a keyframe.
    pub fn drive_on(&self, mapper: &mut Mapper, end: usize) {
        for keyframe in &self.keyframes[mapper.keyframes().len()..end] {
            mapper.push(keyframe.as_ref());
        }
        let is_same = memory(mapper) == self.memories[end - 1];
        assert!(is_same, "another memory at {end} keyframes");
    }
}

/// A lap of the building and a little: loops from the 130th keyframe on.
pub static LAP: LazyLock<Undisturbed> = LazyLock::new(|| {
    let world = World::building();
    let drive = Drive::new(&world, 1300, 1, &[]);
    let lap = Undisturbed::new(config(&world), &drive.keyframes);
    let has = |status| {
        lap.map
            .closures
            .iter()
            .any(|closure| closure.status == status)
    };
    let found = lap.map.closures.iter().filter(|it| it.status.is_loop());
    assert!(lap.keyframes.len() > 280 && found.count() > 30);
    // Edges of the graph, and loops that cost none.
    assert!(lap.map.accepted.len() > 10 && has(LoopStatus::Confirmed));
    lap
});

/// Four laps of a hall of which the first one stays.
pub static KNOWN_GROUND: LazyLock<Undisturbed> = LazyLock::new(|| {
    let drive = &growth::FIVE_LAPS;
    Undisturbed::new(growth::first_lap_only(), &drive.keyframes[..240])
});

/// A whole record of a kind.
pub fn record(kind: [u8; 4], payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u32).to_le_bytes();
    let mut hasher = crc32fast::Hasher::new();
    for bytes in [&kind[..], &length, payload] {
        hasher.update(bytes);
    }
    let checksum = hasher.finalize().to_le_bytes();
    [&kind[..], &length, &checksum, payload].concat()
}

/// The payload of a record.
pub fn payload(record: &[u8]) -> &[u8] {
    &record[12..]
}

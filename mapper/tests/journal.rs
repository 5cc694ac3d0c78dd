//! A mapper that is killed, at whichever keyframe and in the middle of whichever write, comes back as if nothing had
//! happened: its map is that of the undisturbed one, to the last bit.

use crate::support::{Drive, config};
use randt_config::Config;
use randt_mapper::journal::{Bytes, Contents};
use randt_mapper::{Candidate, Known, Mapper, PassedOver, Restored, grid::CellCount, journal};
use randt_messages::{Keyframe, Message};
use randt_simulator::World;
use std::sync::{Arc, LazyLock};

/// All that a mapper knows, bit by bit.
fn memory(mapper: &Mapper) -> Vec<u8> {
    let mut bytes = Vec::new();
    journal::append_snapshot(mapper, Known::default(), &mut bytes).unwrap();
    bytes
}

/// The map at the end: where everything stands, what was decided, and the grid.
#[derive(Debug, PartialEq)]
struct Map {
    poses: Vec<[u64; 3]>,
    parts: Vec<usize>,
    candidates: Vec<Candidate>,
    loops: Vec<Candidate>,
    grid: Vec<(i32, i32, Vec<CellCount>)>,
}

fn finished(mut mapper: Mapper) -> Map {
    mapper.finish();
    let tiles = mapper.grid().tiles();
    Map {
        poses: (mapper.poses().iter())
            .map(|pose| pose.to_array().map(f64::to_bits))
            .collect(),
        parts: (0..mapper.places().len())
            .map(|place| mapper.part_of(place))
            .collect(),
        candidates: mapper.candidates().to_vec(),
        loops: mapper.loops().copied().collect(),
        grid: tiles
            .map(|(index, tile)| (index.x, index.y, tile.cells().collect()))
            .collect(),
    }
}

/// A drive, what an undisturbed mapper made of it, and the journals of it.
struct Undisturbed {
    config: Config,
    keyframes: Vec<Message<Keyframe>>,
    /// Its memory after every keyframe.
    memories: Vec<Vec<u8>>,
    map: Map,
    /// The journal as the process writes it: a snapshot where one is due.
    journal: Vec<u8>,
    /// Where each keyframe's record begins in the journal; the end.
    starts: Vec<usize>,
}

impl Undisturbed {
    fn new(world: &World, drive: Drive) -> Self {
        let config = config(world);
        let mut mapper = Mapper::new(&config);
        let (mut memories, mut starts, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
        journal::begin(&config, &mut bytes);
        let (mut after_snapshot, mut known) = (0, Known::default());
        for (keyframes, keyframe) in (1..).zip(&drive.keyframes) {
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
            keyframes: drive.keyframes,
            memories,
            map: finished(mapper),
            journal: bytes,
            starts,
        }
    }

    /// The journal's header and keyframes alone.
    fn keyframes_only(&self, count: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        journal::begin(&self.config, &mut bytes);
        for keyframe in &self.keyframes[..count] {
            journal::append_keyframe(keyframe.as_ref(), &mut bytes).unwrap();
        }
        bytes
    }

    /// Restores from bytes that end after so many keyframes, and says how.
    fn restored(&self, bytes: &[u8], count: usize) -> (Mapper, Restored) {
        let (mapper, restored) = Mapper::restore(&self.config, bytes).unwrap();
        assert_eq!(mapper.places().len(), count);
        if count > 0 {
            let is_same = memory(&mapper) == self.memories[count - 1];
            assert!(is_same, "another memory after {count} keyframes");
        }
        (mapper, restored)
    }

    /// Drives on to a keyframe.
    fn drive_on(&self, mapper: &mut Mapper, end: usize) {
        for keyframe in &self.keyframes[mapper.places().len()..end] {
            mapper.push(keyframe.as_ref());
        }
        let is_same = memory(mapper) == self.memories[end - 1];
        assert!(is_same, "another memory at {end} keyframes");
    }
}

/// A lap of the building and a little: loops from the 130th keyframe on.
static LAP: LazyLock<Undisturbed> = LazyLock::new(|| {
    let world = World::building();
    let lap = Undisturbed::new(&world, Drive::new(&world, 1300, 1, &[]));
    assert!(lap.keyframes.len() > 280 && lap.map.loops.len() > 30);
    lap
});

#[test]
fn killed_at_any_keyframe_it_comes_back_to_the_last_bit() {
    for count in 0..=LAP.keyframes.len() {
        // Between two records, before and after a snapshot, and in the middle of a write.
        let (start, next) = (LAP.starts[count], LAP.starts.get(count + 1));
        LAP.restored(&LAP.journal[..start], count);
        let Some(&next) = next else { continue };
        let within = start + 1 + (count * 7919) % (next - start - 1);
        let (mapper, restored) = Mapper::restore(&LAP.config, &LAP.journal[..within]).unwrap();
        let found = mapper.places().len();
        assert!(found == count || found == count + 1, "{found} for {count}");
        assert!(found == 0 || memory(&mapper) == LAP.memories[found - 1]);
        assert!(restored.replayed <= 4 && mapper.counters().keyframes_rejected == 0);
    }
}

#[test]
fn driven_on_it_makes_the_map_of_the_undisturbed_one() {
    let end = LAP.keyframes.len();
    for count in (0..end).step_by(13) {
        let (mut mapper, _) = LAP.restored(&LAP.journal[..LAP.starts[count]], count);
        LAP.drive_on(&mut mapper, end);
        assert!(finished(mapper) == LAP.map, "killed after {count}");
    }
}

#[test]
fn a_snapshot_may_stand_anywhere() {
    let end = LAP.keyframes.len();
    for count in 1..end {
        let mut bytes = LAP.keyframes_only(count);
        bytes.extend_from_slice(&LAP.memories[count - 1]);
        let (mut mapper, restored) = LAP.restored(&bytes, count);
        assert_eq!(
            (restored.from_snapshot, restored.replayed),
            (count as u64, 0)
        );
        // What a cache could have carried over shows with the next searches.
        LAP.drive_on(&mut mapper, (count + 9).min(end));
    }
}

/// The payload of a record.
fn payload(record: &[u8]) -> &[u8] {
    &record[12..]
}

#[test]
fn with_a_checkpoint_nothing_is_pushed_anew() {
    let end = LAP.keyframes.len();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let mut journal = journal::JournalFile::open(&path, &LAP.config).unwrap();
    let mut mapper = Mapper::new(&LAP.config);
    let mut before = Vec::new();
    for (count, keyframe) in (1..).zip(&LAP.keyframes) {
        journal.journal.append_keyframe(keyframe.as_ref()).unwrap();
        mapper.push(keyframe.as_ref());
        if journal.journal.is_snapshot_due(&mapper) {
            journal.journal.append_snapshot(&mapper).unwrap();
        }
        let checkpoint = journal.journal.checkpoint(&mapper);
        if count % 5 == 0 || count == end {
            let bytes: Bytes = Arc::new(std::fs::read(&path).unwrap());
            let recalled = |checkpoint| {
                let contents = Contents::of(&bytes).unwrap();
                let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
                (recalled.mapper, recalled.behind.len())
            };
            let (mut again, behind) = recalled(&checkpoint);
            assert_eq!((again.places().len(), behind), (count, 0));
            assert!(memory(&again) == LAP.memories[count - 1], "after {count}");
            LAP.drive_on(&mut again, (count + 3).min(end));
            // Killed before it was written: the one before, unless the journal has a snapshot by then.
            let (again, behind) = recalled(&before);
            assert!(again.places().len() + behind == count && behind <= 1);
        }
        before = checkpoint;
    }
}

#[test]
fn a_checkpoint_that_the_journal_has_left_behind_is_left_out() {
    let count = 200;
    let bytes = LAP.keyframes_only(count);
    let bytes: Bytes = Arc::new([&bytes[..], &LAP.memories[count - 1]].concat());
    for (checkpoint, behind) in [(150, 0), (count, 0)] {
        let checkpoint = payload(&LAP.memories[checkpoint - 1]);
        let contents = Contents::of(&bytes).unwrap();
        let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
        assert_eq!(recalled.behind.len(), behind);
        assert!(memory(&recalled.mapper) == LAP.memories[count - 1]);
    }
    // Without a snapshot it is better than nothing.
    let bytes: Bytes = Arc::new(LAP.keyframes_only(count));
    let contents = Contents::of(&bytes).unwrap();
    let checkpoint = payload(&LAP.memories[149]);
    let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
    assert_eq!(recalled.behind.len(), 50);
}

#[test]
fn a_change_of_what_the_map_is_not_computed_by_costs_nothing() {
    let mut other = LAP.config.clone();
    other.robot.radar_x_m += 0.01;
    let (_, restored) = Mapper::restore(&other, &LAP.journal).unwrap();
    assert!(restored.replayed <= 4 && restored.passed_over.is_none());
}

#[test]
fn a_checkpoint_of_another_journal_is_left_out() {
    let count = 100;
    let mut other = LAP.keyframes_only(0);
    for keyframe in &LAP.keyframes[..count] {
        let mut later = Message::<Keyframe>::default();
        *later.head = *keyframe.head;
        later.items.clone_from(&keyframe.items);
        later.head.header.stamp_ns += 1_000_000_000;
        journal::append_keyframe(later.as_ref(), &mut other).unwrap();
    }
    let keyframes = LAP.keyframes_only(count);
    let ahead = payload(&LAP.memories[count]);
    let own = payload(&LAP.memories[count - 1]);
    for (bytes, checkpoint) in [(&other, own), (&keyframes, ahead), (&keyframes, &own[1..])] {
        let bytes: Bytes = Arc::new(bytes.clone());
        let contents = Contents::of(&bytes).unwrap();
        let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
        assert_eq!(recalled.behind.len(), count);
        assert_eq!(recalled.restored.passed_over, None);
    }
}

#[test]
fn without_snapshots_the_map_is_the_same() {
    let end = LAP.keyframes.len();
    for count in [0, 1, 150, end] {
        let (mapper, restored) = LAP.restored(&LAP.keyframes_only(count), count);
        assert_eq!(
            (restored.replayed, restored.passed_over),
            (count as u64, None)
        );
        assert!(count < end || finished(mapper) == LAP.map);
    }
}

#[test]
fn a_foreign_snapshot_is_passed_over_and_one_that_does_not_fit_too() {
    let count = 200;
    let keyframes = LAP.keyframes_only(count);
    // Of another configuration: the map that this one makes of the keyframes.
    let mut other = LAP.config.clone();
    other.grid.hits_min += 1;
    let (_, restored) = Mapper::restore(&other, &LAP.journal).unwrap();
    assert_eq!(restored.passed_over, Some(PassedOver::Foreign));
    assert_eq!(restored.replayed, LAP.keyframes.len() as u64);
    // Of another drive, or of keyframes that are not there.
    let unfit = [&keyframes[..], &LAP.memories[count + 20]].concat();
    let (_, restored) = LAP.restored(&unfit, count);
    assert_eq!(restored.passed_over, Some(PassedOver::Unfit));
    assert_eq!(restored.replayed, count as u64);
    // The one before it, which fits, is used.
    let second = [
        &keyframes[..],
        &LAP.memories[count - 1],
        &LAP.memories[count + 20],
    ]
    .concat();
    let (_, restored) = LAP.restored(&second, count);
    assert_eq!(
        (restored.from_snapshot, restored.replayed),
        (count as u64, 0)
    );
}

#[test]
fn parts_come_back_unjoined_and_joined() {
    let world = World::building();
    let end_s = world.sweeps() as f64 * 0.2;
    let blackouts = [0.15, 0.35].map(|share| share * end_s..share * end_s + 3.0);
    let drive = Drive::new(&world, world.sweeps(), 1, &blackouts);
    let frames = Undisturbed::new(&world, drive);
    let end = frames.keyframes.len();
    let mut parts = Vec::new();
    for count in (1..=end).step_by(11) {
        let (mut mapper, _) = frames.restored(&frames.journal[..frames.starts[count]], count);
        parts.push(mapper.parts());
        frames.drive_on(&mut mapper, (count + 12).min(end));
        if count % 88 == 1 {
            frames.drive_on(&mut mapper, end);
            assert!(finished(mapper) == frames.map, "killed after {count}");
        }
    }
    assert_eq!(parts.iter().max(), Some(&3), "{parts:?}");
    assert_eq!(parts.last(), Some(&1), "{parts:?}");
}

#[test]
fn killed_again_and_again_it_makes_the_map_of_the_undisturbed_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let mut restarts = 0;
    loop {
        let mut opened = journal::JournalFile::open(&path, &LAP.config).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let (mut mapper, restored) = Mapper::restore(&LAP.config, &bytes).unwrap();
        assert!(restored.replayed <= 4 && restored.passed_over.is_none());
        // Every life is of another length, and its last write is broken off.
        let life = 17 + (restarts * 31) % 29;
        let sent = LAP.keyframes.iter().skip(mapper.places().len());
        for keyframe in sent.take(life) {
            assert!(mapper.is_next(&keyframe.head));
            opened.journal.append_keyframe(keyframe.as_ref()).unwrap();
            mapper.push(keyframe.as_ref());
            if opened.journal.is_snapshot_due(&mapper) {
                opened.journal.append_snapshot(&mapper).unwrap();
            }
        }
        if mapper.places().len() == LAP.keyframes.len() {
            assert!(finished(mapper) == LAP.map);
            break;
        }
        drop(opened);
        let length = std::fs::metadata(&path).unwrap().len();
        let file = std::fs::File::options().append(true).open(&path).unwrap();
        file.set_len(length - 1 - (restarts * 997) as u64 % 9000)
            .unwrap();
        restarts += 1;
    }
    println!("{restarts} restarts");
    assert!(restarts > 8);
}

#[test]
fn hostile_snapshots_are_refused_without_a_panic() {
    let count = 150;
    let keyframes = LAP.keyframes_only(count);
    let good = &LAP.memories[count - 1];
    for n in 0..200_usize {
        let mut payload = good[12..].to_vec();
        let at = 8 + (n * 7919) % (payload.len() - 8);
        match n % 3 {
            0 => payload.truncate(at),
            1 => payload[at] ^= 1 << (n % 8),
            _ => payload[at] = 0xff,
        }
        // As a record that is whole: only what is in it is wrong.
        let mut bytes = keyframes.clone();
        let length = (payload.len() as u32).to_le_bytes();
        let mut hasher = crc32fast::Hasher::new();
        for part in [&good[..4], &length, &payload] {
            hasher.update(part);
        }
        bytes.extend_from_slice(&good[..4]);
        bytes.extend_from_slice(&length);
        bytes.extend_from_slice(&hasher.finalize().to_le_bytes());
        bytes.extend_from_slice(&payload);
        let (mut mapper, _) = Mapper::restore(&LAP.config, &bytes).unwrap();
        // A number that is only another one is believed; the map goes on from there.
        assert_eq!(mapper.places().len(), count);
        for keyframe in &LAP.keyframes[count..count + 8] {
            mapper.push(keyframe.as_ref());
        }
    }
}

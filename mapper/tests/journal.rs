//! A mapper that is killed, at whichever keyframe and in the middle of whichever write, comes back
//! as if nothing had happened: its map is that of the undisturbed one, to the last bit.

use crate::undisturbed::{KNOWN_GROUND, LAP, Undisturbed, finished, memory};
use randt_drives::{Drive, config};
use randt_mapper::{KeyframeIdx, Mapper, journal};
use randt_messages::{Keyframe, Localizability, Message};
use randt_simulator::World;
use std::sync::Arc;

#[test]
fn killed_at_any_keyframe_it_comes_back_to_the_last_bit() {
    for count in 0..=LAP.keyframes.len() {
        // Between two records, before and after a snapshot, and in the middle of a write.
        let (start, next) = (LAP.starts[count], LAP.starts.get(count + 1));
        LAP.restored(&LAP.journal[..start], count);
        let Some(&next) = next else { continue };
        let within = start + 1 + (count * 7919) % (next - start - 1);
        let (mapper, restored) = Mapper::restore(&LAP.config, &LAP.journal[..within]).unwrap();
        let found = mapper.keyframes().len();
        assert!(found == count || found == count + 1, "{found} for {count}");
        assert!(found == 0 || memory(&mapper) == LAP.memories[found - 1]);
        assert!(restored.replayed <= 4 && mapper.counters().keyframes_rejected == 0);
    }
}

/// Builds before keyframes carried how they were judged have written it; this one goes on.
#[test]
fn a_journal_of_keyframes_that_were_not_judged_is_read_and_gone_on_with() {
    let mut bytes = include_bytes!("../../tests/fixtures/layouts-1/map.journal").to_vec();
    let mut judged = Message::<Keyframe>::default();
    judged.head.id = 8;
    judged.head.localizability = Localizability::Partial as u32;
    judged.head.weak_direction_rad = -0.75;
    journal::append_keyframe(judged.as_ref(), &mut bytes).unwrap();
    let bytes: journal::Bytes = Arc::new(bytes);
    let contents = journal::Contents::read(&bytes).unwrap();
    assert_eq!((contents.keyframes.len(), contents.damage), (9, None));
    let mut read = Message::<Keyframe>::default();
    for (id, packed) in (0..).zip(&contents.keyframes) {
        assert!(journal::read_keyframe(packed, &mut read));
        let expected = if id < 8 { (0, 0.0) } else { (2, -0.75) };
        let head = &read.head;
        assert_eq!(head.id, id);
        assert_eq!((head.localizability, head.weak_direction_rad), expected);
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
fn components_come_back_separate_and_merged() {
    let world = World::building();
    let end_s = world.sweeps() as f64 * 0.2;
    let blackouts = [0.15, 0.35].map(|share| share * end_s..share * end_s + 3.0);
    let drive = Drive::new(&world, world.sweeps(), 1, &blackouts);
    let frames = Undisturbed::new(config(&world), &drive.keyframes);
    let end = frames.keyframes.len();
    let mut components = Vec::new();
    for count in (1..=end).step_by(11) {
        let (mut mapper, _) = frames.restored(&frames.journal[..frames.starts[count]], count);
        components.push(mapper.components());
        frames.drive_on(&mut mapper, (count + 12).min(end));
        if count % 88 == 1 {
            frames.drive_on(&mut mapper, end);
            assert!(finished(mapper) == frames.map, "killed after {count}");
        }
    }
    assert_eq!(components.iter().max(), Some(&3), "{components:?}");
    assert_eq!(components.last(), Some(&1), "{components:?}");
}

#[test]
fn killed_while_known_ground_leaves_the_graph_it_comes_back_to_the_last_bit() {
    let laps = &*KNOWN_GROUND;
    let end = laps.keyframes.len();
    let (mut begun, mut gone) = (0, 0);
    for count in 1..end {
        let (mapper, _) = laps.restored(&laps.journal[..laps.starts[count]], count);
        let nodes = (0..count).filter(|index| mapper.is_node(KeyframeIdx(*index)));
        let before = std::mem::replace(&mut gone, count - nodes.count());
        begun += usize::from(gone > before);
        // At the keyframe before some go, and at the one with which they went.
        if gone > before && begun % 4 == 1 {
            for count in [count - 1, count] {
                let (mut mapper, _) = laps.restored(&laps.journal[..laps.starts[count]], count);
                laps.drive_on(&mut mapper, (count + 25).min(end));
            }
            let (mut mapper, _) = laps.restored(&laps.keyframes_only(count), count);
            laps.drive_on(&mut mapper, end);
            assert!(finished(mapper) == laps.map, "killed after {count}");
        }
    }
    println!("{gone} of {end} keyframes have left the graph, {begun} times");
    assert!(begun > 5 && gone > 40, "{gone}, {begun} times");
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
        assert!(restored.replayed <= 4 && restored.rejection.is_none());
        // Every life is of another length, and its last write is broken off.
        let life = 17 + (restarts * 31) % 29;
        let sent = LAP.keyframes.iter().skip(mapper.keyframes().len());
        for keyframe in sent.take(life) {
            assert!(mapper.is_next(&keyframe.head));
            opened.journal.append_keyframe(keyframe.as_ref()).unwrap();
            mapper.push(keyframe.as_ref());
            if opened.journal.is_snapshot_due(&mapper) {
                opened.journal.append_snapshot(&mapper).unwrap();
            }
        }
        if mapper.keyframes().len() == LAP.keyframes.len() {
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

//! Snapshots in a journal and beside it: used where they fit, rejected where they do not.

use crate::undisturbed::{LAP, finished, memory, payload, record};
use randt_mapper::journal::{Bytes, Contents};
use randt_mapper::{Mapper, SnapshotRejection, journal};
use randt_messages::{Keyframe, Message};
use std::sync::Arc;

/// Bytes before a snapshot's state: magic, form, configuration, length, checksum.
const ENVELOPE: usize = 48;

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
                let contents = Contents::read(&bytes).unwrap();
                let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
                (recalled.mapper, recalled.to_replay.len())
            };
            let (mut again, behind) = recalled(&checkpoint);
            assert_eq!((again.keyframes().len(), behind), (count, 0));
            assert!(memory(&again) == LAP.memories[count - 1], "after {count}");
            LAP.drive_on(&mut again, (count + 3).min(end));
            // Killed before it was written: the one before, unless the journal has a snapshot by
            // then.
            let (again, behind) = recalled(&before);
            assert!(again.keyframes().len() + behind == count && behind <= 1);
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
        let contents = Contents::read(&bytes).unwrap();
        let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
        assert_eq!(recalled.to_replay.len(), behind);
        assert!(memory(&recalled.mapper) == LAP.memories[count - 1]);
    }
    // Without a snapshot it is better than nothing.
    let bytes: Bytes = Arc::new(LAP.keyframes_only(count));
    let contents = Contents::read(&bytes).unwrap();
    let checkpoint = payload(&LAP.memories[149]);
    let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
    assert_eq!(recalled.to_replay.len(), 50);
}

#[test]
fn a_change_of_what_the_map_is_not_computed_by_costs_nothing() {
    let mut other = LAP.config.clone();
    other.robot.radar_x_m += 0.01;
    let (_, restored) = Mapper::restore(&other, &LAP.journal).unwrap();
    assert!(restored.replayed <= 4 && restored.rejection.is_none());
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
        let contents = Contents::read(&bytes).unwrap();
        let recalled = Mapper::recall(&LAP.config, contents, Some(checkpoint));
        assert_eq!(recalled.to_replay.len(), count);
        assert_eq!(recalled.restored.rejection, None);
    }
}

#[test]
fn without_snapshots_the_map_is_the_same() {
    let end = LAP.keyframes.len();
    for count in [0, 1, 150, end] {
        let (mapper, restored) = LAP.restored(&LAP.keyframes_only(count), count);
        assert_eq!(
            (restored.replayed, restored.rejection),
            (count as u64, None)
        );
        assert!(count < end || finished(mapper) == LAP.map);
    }
}

#[test]
fn a_foreign_snapshot_is_rejected_and_one_that_does_not_fit_too() {
    let count = 200;
    let keyframes = LAP.keyframes_only(count);
    // Of another configuration: the map that this one makes of the keyframes.
    let mut other = LAP.config.clone();
    other.grid.hits_min += 1;
    let (_, restored) = Mapper::restore(&other, &LAP.journal).unwrap();
    assert_eq!(restored.rejection, Some(SnapshotRejection::Foreign));
    assert_eq!(restored.replayed, LAP.keyframes.len() as u64);
    // Of another drive, or of keyframes that are not there.
    let unfit = [&keyframes[..], &LAP.memories[count + 20]].concat();
    let (_, restored) = LAP.restored(&unfit, count);
    assert_eq!(restored.rejection, Some(SnapshotRejection::Inconsistent));
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

/// A number as the snapshots of forms 1 and 2 had it: seven bits a byte, the least first.
fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[test]
fn a_snapshot_of_an_older_form_is_rejected_and_its_keyframes_are_taken_anew() {
    let count = 40;
    let (header, _) = journal::records(&LAP.journal).unwrap();
    for form in [1, 2] {
        // Form and configuration, keyframes taken, then numbers that another codec wrote.
        let mut payload = Vec::new();
        let numbers = [form, header.config, count as u64, 0, 0, 0, 0, count as u64];
        numbers
            .iter()
            .for_each(|number| varint(*number, &mut payload));
        payload.extend([1; 400]);
        let mut bytes = LAP.keyframes_only(count);
        bytes.extend(record(*b"SNAP", &payload));
        let (_, restored) = LAP.restored(&bytes, count);
        assert_eq!(restored.rejection, Some(SnapshotRejection::Foreign));
        assert_eq!(
            (restored.from_snapshot, restored.replayed),
            (0, count as u64)
        );
        // As the checkpoint beside the journal it is left out.
        let bytes: Bytes = Arc::new(LAP.keyframes_only(count));
        let contents = Contents::read(&bytes).unwrap();
        let recalled = Mapper::recall(&LAP.config, contents, Some(&payload));
        assert_eq!(recalled.to_replay.len(), count);
    }
}

#[test]
fn hostile_snapshots_are_refused_without_a_panic() {
    let count = 150;
    let keyframes = LAP.keyframes_only(count);
    let good = &LAP.memories[count - 1];
    for n in 0..200_usize {
        let mut payload = payload(good).to_vec();
        let at = ENVELOPE + (n * 7919) % (payload.len() - ENVELOPE);
        match n % 3 {
            0 => payload.truncate(at),
            1 => payload[at] ^= 1 << (n % 8),
            _ => payload[at] = 0xff,
        }
        // As an envelope and a record that are whole: only what is in them is wrong.
        let state = payload.len() - ENVELOPE;
        payload[32..40].copy_from_slice(&(state as u64).to_le_bytes());
        payload[40..44].fill(0);
        let checksum = crc32fast::hash(&payload).to_le_bytes();
        payload[40..44].copy_from_slice(&checksum);
        let mut bytes = keyframes.clone();
        bytes.extend(record(*b"SNAP", &payload));
        let (mut mapper, _) = Mapper::restore(&LAP.config, &bytes).unwrap();
        // A number that is only another one is believed; the map goes on from there.
        assert_eq!(mapper.keyframes().len(), count);
        for keyframe in &LAP.keyframes[count..count + 8] {
            mapper.push(keyframe.as_ref());
        }
    }
}

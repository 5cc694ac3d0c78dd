//! A journal that is written anew without what its map no longer needs, while the drive goes on.

use crate::growth;
use crate::undisturbed::{KNOWN_GROUND, finished, memory};
use randt_mapper::journal::{self, JournalFile};
use randt_mapper::{KeyframeIdx, Mapper, SnapshotRejection};
use std::fs;
use std::path::Path;

/// Lets journal and mapper take keyframes up to an end.
fn drive_on(journal: &mut JournalFile, mapper: &mut Mapper, end: usize) {
    for keyframe in &KNOWN_GROUND.keyframes[mapper.keyframes().len()..end] {
        journal.append_keyframe(keyframe.as_ref()).unwrap();
        mapper.push(keyframe.as_ref());
        if journal.is_snapshot_due(mapper) {
            journal.append_snapshot(mapper).unwrap();
        }
    }
}

/// A mapper that comes back from a file, as the undisturbed one was after that many keyframes.
fn back(path: &Path, count: usize) -> Mapper {
    let (mapper, restored) = KNOWN_GROUND.restored(&fs::read(path).unwrap(), count);
    assert!(restored.replayed <= 4 && restored.rejection.is_none());
    mapper
}

#[test]
fn killed_before_in_and_after_a_compaction_it_makes_the_map_of_the_undisturbed_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let copy = folder.path().join("copy");
    let mut journal = JournalFile::open(&path, &KNOWN_GROUND.config)
        .unwrap()
        .journal;
    let mut mapper = Mapper::new(&KNOWN_GROUND.config);
    let end = KNOWN_GROUND.keyframes.len();
    let (mut begun, mut forgotten) = (0, 0);
    for count in [end - 45, end - 25] {
        drive_on(&mut journal, &mut mapper, count);
        // The file is written while two more snapshots and some keyframes come.
        let compaction = journal.begin_compaction(&mapper).unwrap();
        drive_on(&mut journal, &mut mapper, count + 7);
        let compacted = compaction.run().unwrap();
        drive_on(&mut journal, &mut mapper, count + 10);
        let before = journal.length();
        let part = folder.path().join("map.journal.compacted.part");
        let new = fs::metadata(&part).unwrap().len() as usize;
        back(&path, count + 10);
        journal.finish_compaction(compacted).unwrap();
        assert!(!part.exists() && journal.length() < before);
        back(&path, count + 10);
        // What the disk had of it, and any cut of what has come since.
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes.len() as u64, journal.length());
        fs::write(&copy, &bytes[..new]).unwrap();
        let mut again = back(&copy, count);
        KNOWN_GROUND.drive_on(&mut again, count + 10);
        for cut in (new..bytes.len()).step_by(9973) {
            let (mapper, restored) = Mapper::restore(&KNOWN_GROUND.config, &bytes[..cut]).unwrap();
            let found = mapper.keyframes().len();
            assert!((count..=count + 10).contains(&found) && restored.replayed <= 4);
            assert!(memory(&mapper) == KNOWN_GROUND.memories[found - 1]);
        }
        // What is forgotten has no more than its numbers.
        let (_, records) = journal::records(&bytes).unwrap();
        let stand = |it: &journal::Record<'_>| journal::read_attached(it.payload).is_some();
        let attached: Vec<_> = records
            .of_kind(journal::Kind::Keyframe)
            .filter(stand)
            .collect();
        begun += usize::from(attached.len() > forgotten);
        forgotten = attached.len();
        assert!(attached.iter().all(|it| it.payload.len() < 300));
        println!(
            "{before} bytes become {}, {forgotten} forgotten",
            bytes.len()
        );
    }
    assert!(begun == 2 && forgotten > 20, "{forgotten} in {begun} steps");
    // A life that begins with the compacted journal and goes on with it.
    drop(journal);
    let mut journal = JournalFile::open(&path, &KNOWN_GROUND.config)
        .unwrap()
        .journal;
    let mut mapper = back(&path, end - 15);
    drive_on(&mut journal, &mut mapper, end);
    assert!(finished(back(&path, end)) == KNOWN_GROUND.map);
    assert!(finished(mapper) == KNOWN_GROUND.map);
}

#[test]
fn another_configuration_makes_its_map_of_a_compacted_journal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let mut journal = JournalFile::open(&path, &KNOWN_GROUND.config)
        .unwrap()
        .journal;
    let mut mapper = Mapper::new(&KNOWN_GROUND.config);
    let end = KNOWN_GROUND.keyframes.len();
    drive_on(&mut journal, &mut mapper, end);
    let compaction = journal.begin_compaction(&mapper).unwrap();
    journal
        .finish_compaction(compaction.run().unwrap())
        .unwrap();
    let mut other = growth::first_lap_only();
    other.loops.candidates += 1;
    let (again, restored) = Mapper::restore(&other, &fs::read(&path).unwrap()).unwrap();
    assert_eq!(restored.rejection, Some(SnapshotRejection::Foreign));
    assert_eq!(
        (restored.replayed, again.keyframes().len()),
        (end as u64, end)
    );
    let all = || (0..end).map(KeyframeIdx);
    let gone = |mapper: &Mapper| all().filter(|it| !mapper.is_node(*it)).count();
    // None that was forgotten is a node again, and each stands where it did.
    for it in all().filter(|it| !mapper.remembers(*it)) {
        assert!(!again.is_node(it));
        let off = again.poses()[it.0].between(&mapper.poses()[it.0]);
        assert!(off.translation().norm() < 0.05, "{off:?}");
    }
    let forgotten = all().filter(|it| !mapper.remembers(*it)).count();
    println!(
        "{} and {} gone, {forgotten} forgotten",
        gone(&mapper),
        gone(&again)
    );
    assert!(forgotten > 20);
    assert!(gone(&again) > 20);
    // It comes back as it is.
    let mut bytes = fs::read(&path).unwrap();
    bytes.extend(memory(&again));
    let (back, restored) = Mapper::restore(&other, &bytes).unwrap();
    assert_eq!((restored.replayed, restored.rejection), (0, None));
    assert!(memory(&back) == memory(&again) && finished(back) == finished(again));
}

#[test]
fn what_is_appended_during_a_sync_is_not_on_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let mut journal = JournalFile::open(&path, &KNOWN_GROUND.config)
        .unwrap()
        .journal;
    let append = |journal: &mut JournalFile, at: usize| {
        journal
            .append_keyframe(KNOWN_GROUND.keyframes[at].as_ref())
            .unwrap();
    };
    append(&mut journal, 0);
    let sync = journal.begin_sync().unwrap();
    append(&mut journal, 1);
    let synced = std::thread::spawn(move || sync.run()).join().unwrap();
    assert_eq!(journal.on_disk(), 0);
    journal.finish_sync(synced).unwrap();
    assert_eq!((journal.on_disk(), journal.end()), (1, 2));
}

//! The journal's file: cut at any byte, locked, damaged, foreign, full. None is ever thrown away
//! in silence.

use randt_config::Config;
use randt_mapper::Mapper;
use randt_mapper::journal::{self, Error, JournalFile, Kind, Opened};
use randt_messages::{Keyframe, KeyframePoint, Message};
use std::fs;
use std::path::Path;

fn keyframe(id: u64) -> Message<Keyframe> {
    let mut keyframe = Message::<Keyframe>::default();
    keyframe.head.id = id;
    keyframe.head.header.stamp_ns = 1_000_000_000 * id as i64;
    keyframe.head.pose = [0.5 * id as f64, 0.0, 0.1];
    keyframe.items.extend((0..20).map(|n| KeyframePoint {
        x_m: 0.1 * n as f32,
        y_m: 2.0,
        intensity: 9.0 + (n % 3) as f32,
        beam: 0,
        reserved: 0,
    }));
    keyframe
}

/// Opens a journal, restores its mapper, and lets both take keyframes.
fn drive(path: &Path, ids: impl IntoIterator<Item = u64>) -> (Opened, Mapper) {
    let config = Config::default();
    let mut opened = JournalFile::open(path, &config).unwrap();
    let (mut mapper, _) = Mapper::restore(&config, &fs::read(path).unwrap()).unwrap();
    for id in ids {
        let keyframe = keyframe(id);
        opened.journal.append_keyframe(keyframe.as_ref()).unwrap();
        assert!(mapper.push(keyframe.as_ref()));
        if opened.journal.is_snapshot_due(&mapper) {
            opened.journal.append_snapshot(&mapper).unwrap();
        }
    }
    (opened, mapper)
}

fn ids(mapper: &Mapper) -> Vec<u64> {
    mapper
        .keyframes()
        .iter()
        .map(|keyframe| keyframe.keyframe_id)
        .collect()
}

#[test]
fn it_is_begun_and_continued_and_knows_what_is_on_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let (mut opened, _) = drive(&path, 0..3);
    assert_eq!(opened.journal.on_disk(), 0);
    opened.journal.sync().unwrap();
    assert_eq!(opened.journal.on_disk(), 3);
    let length = opened.journal.length();
    drop(opened);
    assert_eq!(fs::metadata(&path).unwrap().len(), length);

    let (opened, mapper) = drive(&path, 3..40);
    assert!(opened.cut.is_none() && opened.quarantined.is_none());
    assert_eq!(
        opened.journal.on_disk(),
        3,
        "what was there when it was opened"
    );
    assert_eq!(ids(&mapper), (0..40).collect::<Vec<_>>());
    drop(opened);
    let bytes = fs::read(&path).unwrap();
    let (_, records) = journal::records(&bytes).unwrap();
    assert_eq!(records.of_kind(Kind::Snapshot).count(), 10);
    let (again, restored) = Mapper::restore(&Config::default(), &bytes).unwrap();
    assert_eq!(again.poses(), mapper.poses());
    assert_eq!((restored.from_snapshot, restored.replayed), (40, 0));
}

#[test]
fn two_mappers_never_write_one_journal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let (opened, mapper) = drive(&path, 0..3);
    let locked = |path: &Path| {
        let error = JournalFile::open(path, &Config::default()).unwrap_err();
        assert!(matches!(error, Error::Locked { .. }), "{error}");
    };
    locked(&path);
    drop(opened);
    let (_, again) = drive(&path, []);
    assert_eq!(again.poses(), mapper.poses());
}

#[test]
fn cut_at_any_byte_of_the_last_record_it_has_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    let (mut opened, _) = drive(&path, 0..4);
    let start = opened.journal.length() as usize;
    opened
        .journal
        .append_keyframe(keyframe(4).as_ref())
        .unwrap();
    drop(opened);
    let whole = fs::read(&path).unwrap();
    for end in start..whole.len() {
        // As a power cut leaves it: short, or long enough and without the bytes.
        for is_zeroed in [false, true] {
            let mut bytes = whole[..end].to_vec();
            if is_zeroed {
                bytes.resize(whole.len() + 4096, 0);
            }
            fs::write(&path, &bytes).unwrap();
            let (mut opened, mapper) = drive(&path, []);
            assert_eq!(ids(&mapper), [0, 1, 2, 3], "cut at {end}");
            assert_eq!(opened.cut.is_some(), bytes.len() > start);
            assert_eq!(opened.journal.length(), start as u64);
            assert_eq!((opened.quarantined, opened.journal.on_disk()), (None, 4));
            opened
                .journal
                .append_keyframe(keyframe(4).as_ref())
                .unwrap();
            drop(opened.journal);
            assert!(fs::read(&path).unwrap() == whole, "appended again at {end}");
        }
    }
}

#[test]
fn what_is_damaged_is_quarantined_and_what_is_none_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.journal");
    drop(drive(&path, 0..6));
    let whole = fs::read(&path).unwrap();
    let (_, mut records) = journal::records(&whole).unwrap();
    let ends: Vec<usize> = std::iter::from_fn(|| records.next().map(|_| records.good())).collect();
    let mut damaged = whole.clone();
    damaged[ends[2] + 30] ^= 4;
    fs::write(&path, &damaged).unwrap();
    let (opened, mapper) = drive(&path, []);
    let (quarantined, why) = opened.quarantined.unwrap();
    assert!(
        opened.cut.is_none() && why.contains(&ends[2].to_string()),
        "{why}"
    );
    assert_eq!(fs::read(&quarantined).unwrap(), damaged);
    assert_eq!((ids(&mapper), opened.journal.on_disk()), (vec![0, 1, 2], 3));
    drop(opened.journal);
    assert_eq!(fs::read(&path).unwrap(), whole[..ends[2]]);

    let beginning = whole[..10].to_vec();
    fs::write(&path, &beginning).unwrap();
    let (opened, mapper) = drive(&path, [7]);
    let (another, _) = opened.quarantined.unwrap();
    assert!(another != quarantined && fs::read(&another).unwrap() == beginning);
    assert_eq!(ids(&mapper), [7]);
    drop(opened.journal);
    // What never was a journal is another program's file under a wrong name.
    let picture = b"P5\n640 480\n255\n";
    fs::write(&path, picture).unwrap();
    let refused = JournalFile::open(&path, &Config::default()).unwrap_err();
    assert!(
        refused.to_string().contains("not a mapper's journal"),
        "{refused}"
    );
    assert_eq!(fs::read(&path).unwrap(), picture);
    // An empty one is no journal yet.
    fs::write(&path, b"").unwrap();
    assert_eq!(drive(&path, []).0.quarantined, None);
}

#[test]
fn a_folder_that_is_not_there_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let error =
        JournalFile::open(folder.path().join("no/journal"), &Config::default()).unwrap_err();
    assert!(error.to_string().contains("no/journal"), "{error}");
}

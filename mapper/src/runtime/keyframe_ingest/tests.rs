//! A journal that grows, is opened again, and odometry that is away, has forgotten or is another
//! one.

use super::super::keyframe_sequence::REFUSALS_MAX;
use super::*;
use randt_messages::Message;
use randt_stage::Domain;
use std::path::PathBuf;
use tempfile::TempDir;

/// A domain with a mapper in it, and where its journal lies.
struct Scene {
    run: TempDir,
    domain: Domain,
    stage: Stage,
}

impl Scene {
    fn new(name: &str) -> Self {
        let run = tempfile::tempdir().unwrap();
        let prefix = format!("{name}-{}", std::process::id());
        let domain = Domain::new(&prefix, Some(run.path())).unwrap();
        let stage = Stage::open("mapper", &domain).unwrap();
        Self { run, domain, stage }
    }

    fn journal(&self) -> PathBuf {
        self.run.path().join("map.journal")
    }

    fn open(&mut self, config: &Config) -> KeyframeIngest {
        KeyframeIngest::open(&self.journal(), config, &mut self.stage).unwrap()
    }

    fn begin_anew(&mut self, ingest: KeyframeIngest) -> KeyframeIngest {
        let config = Config::default();
        let ingest = ingest.begin_anew(&self.journal(), &config, &mut self.stage);
        ingest.unwrap()
    }

    fn end(self) {
        drop(self.stage);
        randt_stage::wipe(&self.domain, true).unwrap();
    }
}

/// The default configuration's rules, and others.
fn rules() -> (Config, Config) {
    let mut other = Config::default();
    other.grid.hits_min += 1;
    (Config::default(), other)
}

fn keyframe(id: u64, odom_frame_id: u64) -> Message<Keyframe> {
    let mut message = Message::<Keyframe>::default();
    message.head.id = id;
    message.head.odom_frame_id = odom_frame_id;
    message.head.header.stamp_ns = 1_000_000_000 * (id as i64 + 1);
    message
}

fn take(ingest: &mut KeyframeIngest, ids: impl IntoIterator<Item = u64>, odom_frame_id: u64) {
    for id in ids {
        ingest.take(keyframe(id, odom_frame_id).as_ref());
    }
}

/// Keyframes that the map has.
fn taken(ingest: &KeyframeIngest) -> usize {
    ingest.mapper.keyframes().len()
}

#[test]
fn a_map_that_is_behind_takes_what_comes_after_what_was_there() {
    let mut scene = Scene::new("behind");
    let (config, other) = rules();
    let mut ingest = scene.open(&config);
    take(&mut ingest, 0..10, 0);
    drop(ingest);

    // Killed: all is there at once.
    let ingest = scene.open(&config);
    assert_eq!((taken(&ingest), ingest.is_behind()), (10, false));
    drop(ingest);

    // By other rules all has to be made anew.
    let mut ingest = scene.open(&other);
    assert_eq!((taken(&ingest), ingest.sequence.next), (0, 10));
    assert!(!ingest.is_as_published() && !ingest.catch_up());
    take(&mut ingest, [9, 10, 11], 0);
    assert_eq!((taken(&ingest), ingest.sequence.next), (1, 12));
    assert_eq!(ingest.delay(), "takes its keyframes anew, 1 of 12");
    // What it has of them is kept where it ends before it is done.
    ingest.finish();
    drop(ingest);
    let mut ingest = scene.open(&other);
    assert_eq!((taken(&ingest), ingest.sequence.next), (1, 12));
    let done = (0..11).filter(|_| ingest.catch_up()).count();
    assert_eq!(
        (done, ingest.is_behind(), ingest.delay().as_str()),
        (1, false, "")
    );
    assert_eq!((taken(&ingest), ingest.sequence.lost), (12, 0));
    drop(ingest);
    scene.end();
}

#[test]
fn the_published_frame_is_the_journals_and_unknown_odometry_does_not_go_on_in_it() {
    let mut scene = Scene::new("frame");
    let (config, other) = rules();
    let mut ingest = scene.open(&config);
    take(&mut ingest, 0..3, 0);
    take(&mut ingest, 3..6, 1);
    drop(ingest);
    let mut ingest = scene.open(&other);
    assert_eq!((taken(&ingest), ingest.newest_frame()), (0, Some(1)));
    for _ in 0..REFUSALS_MAX {
        assert!(!ingest.sequence.is_other_drive && ingest.sequence.next == 6);
        ingest.sequence.request();
        take(&mut ingest, [6], 1);
    }
    assert!(ingest.sequence.is_other_drive);
    drop(ingest);

    // A new frame needs no proof.
    let mut ingest = scene.open(&other);
    take(&mut ingest, [6], 2);
    assert_eq!((ingest.sequence.next, ingest.newest_frame()), (7, Some(2)));
    drop(ingest);
    scene.end();
}

#[test]
fn another_drive_is_seen_in_a_keyframe_that_the_map_does_not_have_yet() {
    let mut scene = Scene::new("other");
    let (config, other) = rules();
    let mut ingest = scene.open(&config);
    take(&mut ingest, 0..6, 0);
    drop(ingest);
    let mut ingest = scene.open(&other);
    assert!(ingest.is_behind());
    let mut foreign = keyframe(5, 0);
    foreign.head.header.stamp_ns += 1;
    ingest.take(foreign.as_ref());
    assert!(ingest.sequence.is_other_drive);
    let mut ingest = scene.begin_anew(ingest);
    assert_eq!((taken(&ingest), ingest.sequence.next), (0, 0));
    take(&mut ingest, [0], 0);
    assert_eq!((taken(&ingest), ingest.sequence.is_other_drive), (1, false));
    drop(ingest);
    scene.end();
}

#[test]
fn missing_keyframes_are_waited_for_until_odometry_has_none() {
    let mut scene = Scene::new("missing");
    let mut ingest = scene.open(&Config::default());
    take(&mut ingest, [0, 1, 1, 0, 2], 0);
    assert_eq!(
        (ingest.sequence.next, ingest.sequence.request()),
        (3, false)
    );

    // Odometry is away for long: one keyframe that was on its way, then nothing.
    take(&mut ingest, [5], 0);
    for _ in 0..100 {
        assert!(ingest.sequence.request());
    }
    // It is back and goes on before it hears the requests, then it answers.
    take(&mut ingest, [6, 7, 3, 4, 5, 6, 7, 8], 0);
    assert_eq!(
        (
            ingest.sequence.next,
            ingest.sequence.lost,
            ingest.sequence.request()
        ),
        (9, 0, false)
    );

    // It does not have it any more.
    for _ in 0..REFUSALS_MAX {
        assert_eq!(ingest.sequence.next, 9);
        take(&mut ingest, [12, 13], 0);
        ingest.sequence.request();
    }
    take(&mut ingest, [12], 0);
    assert_eq!((ingest.sequence.next, ingest.sequence.lost), (13, 3));
    drop(ingest);
    scene.end();
}

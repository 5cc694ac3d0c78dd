//! A journal that grows, is opened again, and odometry that is away, has forgotten or is another one.

use super::*;
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

    fn open(&mut self, config: &Config) -> Intake {
        Intake::open(&self.journal(), config, &mut self.stage).unwrap()
    }

    fn begin_anew(&mut self, intake: Intake) -> Intake {
        let config = Config::default();
        let intake = intake.begin_anew(&self.journal(), &config, &mut self.stage);
        intake.unwrap()
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

fn take(intake: &mut Intake, ids: impl IntoIterator<Item = u64>, odom_frame_id: u64) {
    for id in ids {
        intake.take(keyframe(id, odom_frame_id).as_ref());
    }
}

/// Keyframes that the map has.
fn taken(intake: &Intake) -> usize {
    intake.mapper.places().len()
}

#[test]
fn a_map_that_is_behind_takes_what_comes_after_what_was_there() {
    let mut scene = Scene::new("behind");
    let (config, other) = rules();
    let mut intake = scene.open(&config);
    take(&mut intake, 0..10, 0);
    drop(intake);

    // Killed: all is there at once.
    let intake = scene.open(&config);
    assert_eq!((taken(&intake), intake.is_behind()), (10, false));
    drop(intake);

    // By other rules all has to be made anew.
    let mut intake = scene.open(&other);
    assert_eq!((taken(&intake), intake.next()), (0, 10));
    assert!(!intake.is_as_told() && !intake.catch_up());
    take(&mut intake, [9, 10, 11], 0);
    assert_eq!((taken(&intake), intake.next()), (1, 12));
    assert_eq!(intake.delay(), "takes its keyframes anew, 1 of 12");
    // What it has of them is kept where it ends before it is done.
    intake.finish();
    drop(intake);
    let mut intake = scene.open(&other);
    assert_eq!((taken(&intake), intake.next()), (1, 12));
    let done = (0..11).filter(|_| intake.catch_up()).count();
    assert_eq!(
        (done, intake.is_behind(), intake.delay().as_str()),
        (1, false, "")
    );
    assert_eq!((taken(&intake), intake.lost), (12, 0));
    drop(intake);
    scene.end();
}

#[test]
fn the_frame_that_is_told_is_the_journals_and_nobody_goes_on_in_it_unknown() {
    let mut scene = Scene::new("frame");
    let (config, other) = rules();
    let mut intake = scene.open(&config);
    take(&mut intake, 0..3, 0);
    take(&mut intake, 3..6, 1);
    drop(intake);
    let mut intake = scene.open(&other);
    assert_eq!((taken(&intake), intake.newest_frame()), (0, Some(1)));
    for _ in 0..REFUSALS_MAX {
        assert!(!intake.is_other_drive && intake.next() == 6);
        intake.request();
        take(&mut intake, [6], 1);
    }
    assert!(intake.is_other_drive);
    drop(intake);

    // A new frame needs no proof.
    let mut intake = scene.open(&other);
    take(&mut intake, [6], 2);
    assert_eq!((intake.next(), intake.newest_frame()), (7, Some(2)));
    drop(intake);
    scene.end();
}

#[test]
fn another_drive_is_seen_in_a_keyframe_that_the_map_does_not_have_yet() {
    let mut scene = Scene::new("other");
    let (config, other) = rules();
    let mut intake = scene.open(&config);
    take(&mut intake, 0..6, 0);
    drop(intake);
    let mut intake = scene.open(&other);
    assert!(intake.is_behind());
    let mut foreign = keyframe(5, 0);
    foreign.head.header.stamp_ns += 1;
    intake.take(foreign.as_ref());
    assert!(intake.is_other_drive);
    let mut intake = scene.begin_anew(intake);
    assert_eq!((taken(&intake), intake.next()), (0, 0));
    take(&mut intake, [0], 0);
    assert_eq!((taken(&intake), intake.is_other_drive), (1, false));
    drop(intake);
    scene.end();
}

#[test]
fn missing_keyframes_are_waited_for_until_odometry_has_none() {
    let mut scene = Scene::new("missing");
    let mut intake = scene.open(&Config::default());
    take(&mut intake, [0, 1, 1, 0, 2], 0);
    assert_eq!((intake.next(), intake.request()), (3, false));

    // Odometry is away for long: one keyframe that was on its way, then nothing.
    take(&mut intake, [5], 0);
    for _ in 0..100 {
        assert!(intake.request());
    }
    // It is back and goes on before it hears the requests, then it answers.
    take(&mut intake, [6, 7, 3, 4, 5, 6, 7, 8], 0);
    assert_eq!(
        (intake.next(), intake.lost, intake.request()),
        (9, 0, false)
    );

    // It does not have it any more.
    for _ in 0..REFUSALS_MAX {
        assert_eq!(intake.next(), 9);
        take(&mut intake, [12, 13], 0);
        intake.request();
    }
    take(&mut intake, [12], 0);
    assert_eq!((intake.next(), intake.lost), (13, 3));
    drop(intake);
    scene.end();
}

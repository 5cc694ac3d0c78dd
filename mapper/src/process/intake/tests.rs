//! A journal that grows, is opened again, and odometry that is away, has forgotten or is another one.

use super::*;
use randt_stage::Realm;

fn keyframe(id: u64) -> Message<Keyframe> {
    let mut message = Message::<Keyframe>::default();
    message.head.id = id;
    message.head.header.stamp_ns = 1_000_000_000 * (id as i64 + 1);
    message
}

#[test]
fn a_map_that_is_behind_takes_what_comes_after_what_was_there() {
    let run = tempfile::tempdir().unwrap();
    let prefix = format!("behind-{}", std::process::id());
    let realm = Realm::new(&prefix, Some(run.path())).unwrap();
    let mut stage = Stage::open("mapper", &realm).unwrap();
    let journal = run.path().join("map.journal");
    let mut intake = Intake::open(&journal, &Config::default(), &mut stage).unwrap();
    for id in 0..10 {
        intake.take(keyframe(id).as_ref());
    }
    intake.finish();
    drop(intake);
    let taken = |intake: &Intake| intake.mapper.places().len();

    // Killed: all is there at once.
    let intake = Intake::open(&journal, &Config::default(), &mut stage).unwrap();
    assert_eq!((taken(&intake), intake.is_behind()), (10, false));
    drop(intake);

    // By other rules all has to be made anew.
    let mut other = Config::default();
    other.grid.hits_min += 1;
    let mut intake = Intake::open(&journal, &other, &mut stage).unwrap();
    assert_eq!((taken(&intake), intake.next()), (0, 10));
    intake.catch_up();
    for id in [9, 10, 11] {
        intake.take(keyframe(id).as_ref());
    }
    assert_eq!((taken(&intake), intake.next()), (1, 12));
    assert_eq!(intake.progress(), "takes its keyframes anew, 1 of 12");
    // What it has of them is kept where it ends before it is done.
    intake.finish();
    drop(intake);
    let mut intake = Intake::open(&journal, &other, &mut stage).unwrap();
    assert_eq!((taken(&intake), intake.next()), (1, 12));
    while intake.is_behind() {
        intake.catch_up();
    }
    assert_eq!((taken(&intake), intake.lost), (12, 0));

    // Whoever begins to number goes on after the journal's frame, not after the map's; who goes on in it without having
    // the keyframe before is another drive.
    drop(intake);
    let mut newer = keyframe(12);
    newer.head.odom_frame_id = 1;
    let mut intake = Intake::open(&journal, &other, &mut stage).unwrap();
    intake.take(newer.as_ref());
    drop(intake);
    let mut intake = Intake::open(&journal, &Config::default(), &mut stage).unwrap();
    let frames = |intake: &Intake| {
        let newest = intake.mapper.places().last();
        (
            newest.map(|place| place.odom_frame_id),
            intake.newest_frame(),
        )
    };
    assert_eq!(frames(&intake), (Some(0), Some(1)));
    let mut next = keyframe(13);
    next.head.odom_frame_id = 1;
    for _ in 0..REFUSALS_MAX {
        assert!(!intake.is_other_drive && intake.next() == 13);
        intake.request();
        intake.take(next.as_ref());
    }
    assert!(intake.is_other_drive);

    // Another drive is seen in a keyframe that the map does not have yet.
    drop(intake);
    let mut intake = Intake::open(&journal, &Config::default(), &mut stage).unwrap();
    assert!(intake.is_behind());
    let mut foreign = keyframe(12);
    foreign.head.header.stamp_ns += 1;
    intake.take(foreign.as_ref());
    assert!(intake.is_other_drive);
    let config = Config::default();
    let mut intake = intake.begin_anew(&journal, &config, &mut stage).unwrap();
    assert_eq!((taken(&intake), intake.next()), (0, 0));
    intake.take(keyframe(0).as_ref());
    assert_eq!((taken(&intake), intake.is_other_drive), (1, false));
    drop(stage);
    randt_stage::wipe(&realm, true).unwrap();
}

#[test]
fn missing_keyframes_are_waited_for_until_odometry_has_none() {
    let run = tempfile::tempdir().unwrap();
    let prefix = format!("intake-{}", std::process::id());
    let realm = Realm::new(&prefix, Some(run.path())).unwrap();
    let mut stage = Stage::open("mapper", &realm).unwrap();
    let journal = run.path().join("map.journal");
    let mut intake = Intake::open(&journal, &Config::default(), &mut stage).unwrap();
    for id in [0, 1, 1, 0, 2] {
        intake.take(keyframe(id).as_ref());
    }
    assert_eq!((intake.next(), intake.request()), (3, false));

    // Odometry is away for long: one keyframe that was on its way, then nothing.
    intake.take(keyframe(5).as_ref());
    for _ in 0..100 {
        assert!(intake.request());
    }
    // It is back and goes on before it hears the requests, then it answers.
    for id in [6, 7, 3, 4, 5, 6, 7, 8] {
        intake.take(keyframe(id).as_ref());
    }
    assert_eq!(
        (intake.next(), intake.lost, intake.request()),
        (9, 0, false)
    );

    // It does not have it any more.
    for _ in 0..REFUSALS_MAX {
        assert_eq!(intake.next(), 9);
        intake.take(keyframe(12).as_ref());
        intake.take(keyframe(13).as_ref());
        intake.request();
    }
    intake.take(keyframe(12).as_ref());
    assert_eq!((intake.next(), intake.lost), (13, 3));
    drop(stage);
    randt_stage::wipe(&realm, true).unwrap();
}

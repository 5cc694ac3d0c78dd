//! Odometry may be killed after any input: restored, it goes on to the same bits.

use crate::support::{
    Input, Outcome, config_that_bridges_no_gap as config, index_of, inputs, shift_scan,
};
use proptest::prelude::*;
use randt_odometry::{Error, Odometry};
use std::sync::LazyLock;

/// Most bytes that the state may have.
const ROOM: usize = 1 << 20;

/// A drive of 48 s with the standstill at its start, turns, a gap that opens a frame, and a scan
/// twice.
static DRIVE: LazyLock<Vec<Input>> = LazyLock::new(|| {
    let mut inputs = inputs(240);
    for scan in (150..157).rev() {
        inputs.remove(index_of(&inputs, scan));
    }
    let twice = index_of(&inputs, 100);
    inputs.insert(twice, inputs[twice].clone());
    // IMU samples that are late: scans wait.
    for scan in [30, 90, 91, 160] {
        let at = index_of(&inputs, scan);
        let early = inputs.remove(at);
        inputs.insert(at - 12, early);
    }
    inputs
});

/// A buffer that is not clean, as the one before left it.
fn save(odometry: &Odometry) -> Vec<u8> {
    let mut bytes = vec![0xa5; ROOM];
    let length = odometry.save(&mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

fn restore(bytes: &[u8]) -> Odometry {
    Odometry::restore(&config(), true, bytes).unwrap()
}

/// Runs the drive; `disturb` may replace odometry after each input.
fn run(mut disturb: impl FnMut(usize, &Input, Odometry) -> Odometry) -> Outcome {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    for (i, input) in DRIVE.iter().enumerate() {
        input.push(&mut odometry, &mut outcome);
        odometry = disturb(i, input, odometry);
    }
    odometry.finish(&mut outcome);
    outcome.counters = odometry.counters();
    outcome
}

static UNDISTURBED: LazyLock<Outcome> = LazyLock::new(|| run(|_, _, odometry| odometry));

fn assert_same(outcome: &Outcome) {
    assert_eq!(outcome.counters, UNDISTURBED.counters);
    assert_eq!(outcome.states.len(), UNDISTURBED.states.len());
    let differs = outcome
        .states
        .iter()
        .zip(&UNDISTURBED.states)
        .position(|(a, b)| a != b);
    assert_eq!(differs, None, "a state differs");
    assert!(outcome.bytes == UNDISTURBED.bytes, "a keyframe differs");
}

#[test]
fn killed_after_every_scan_it_goes_on_to_the_same_bits() {
    let outcome = run(|_, input, odometry| match input {
        Input::Points(_) => restore(&save(&odometry)),
        Input::Imu(_) | Input::Twist(_) => odometry,
    });
    assert_eq!(outcome.states.len(), 233);
    assert_eq!(outcome.counters.frames_reopened, 1);
    assert_eq!(outcome.counters.scans_repeated, 1);
    assert!(outcome.keyframes.len() > 20, "{}", outcome.keyframes.len());
    let submaps = outcome.states.last().unwrap().submap_id;
    assert!(submaps >= 2, "{submaps} submaps");
    assert_same(&outcome);
}

#[test]
fn killed_while_scans_and_samples_wait_it_goes_on_to_the_same_bits() {
    let mut waiting = 0;
    let outcome = run(|i, _, odometry| {
        let waits = odometry.waiting_for_ns().is_some();
        waiting += usize::from(waits);
        if waits || i % 17 == 0 {
            let restored = restore(&save(&odometry));
            assert_eq!(restored.waiting_for_ns(), odometry.waiting_for_ns());
            assert_eq!(restored.last_scan(), odometry.last_scan());
            assert_eq!(restored.last_imu(), odometry.last_imu());
            assert_eq!(restored.pose_record(), odometry.pose_record());
            assert_eq!(restored.counters(), odometry.counters());
            restored
        } else {
            odometry
        }
    });
    assert!(waiting > 40, "{waiting} inputs while a scan waited");
    assert_same(&outcome);
}

#[test]
fn a_restored_state_is_saved_to_the_same_bytes() {
    run(|i, _, odometry| {
        if i % 501 == 0 {
            let bytes = save(&odometry);
            let restored = restore(&bytes);
            assert!(save(&restored) == bytes, "after input {i}");
            return restored;
        }
        odometry
    });
}

#[test]
fn it_is_the_same_without_an_imu() {
    let scans = DRIVE
        .iter()
        .filter(|input| matches!(input, Input::Points(_)))
        .take(60);
    let mut plain = Odometry::new(&config(), false);
    let mut killed = Odometry::new(&config(), false);
    let (mut one, mut other) = (Outcome::default(), Outcome::default());
    for scan in scans {
        scan.push(&mut plain, &mut one);
        scan.push(&mut killed, &mut other);
        killed = Odometry::restore(&config(), false, &save(&killed)).unwrap();
    }
    assert!(one.states.len() == 60 && one.bytes == other.bytes);
}

/// States from here and there in the drive.
static SAVED: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let mut saved = Vec::new();
    let mut scans = 0;
    run(|i, input, odometry| {
        scans += usize::from(matches!(input, Input::Points(_)));
        if i == 5 || (matches!(input, Input::Points(_)) && [1, 2, 31, 92, 200].contains(&scans)) {
            saved.push(save(&odometry));
        }
        odometry
    });
    assert_eq!(saved.len(), 6);
    saved
});

/// Makes the checksum right again (core/persist: over head and state, with zero in its own place).
fn fix_checksum(bytes: &mut [u8]) {
    bytes[40..44].fill(0);
    let crc = crc32fast::hash(bytes);
    bytes[40..44].copy_from_slice(&crc.to_le_bytes());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damage_is_an_error(which in 0..6_usize, at in any::<prop::sample::Index>(), bit in 0..8_u32, cut in any::<bool>()) {
        let mut bytes = SAVED[which].clone();
        let at = at.index(bytes.len());
        if cut {
            bytes.truncate(at);
        } else {
            bytes[at] ^= 1_u8 << bit;
        }
        prop_assert!(Odometry::restore(&config(), true, &bytes).is_err());
    }

    #[test]
    fn hostile_values_are_an_error_or_are_worked_with(
        which in 0..6_usize,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        extreme in any::<bool>(),
    ) {
        let mut bytes = SAVED[which].clone();
        for (at, value) in flips {
            // The head is another test's.
            let at = 48 + at.index(bytes.len() - 48);
            let end = if extreme { (at + 8).min(bytes.len()) } else { at + 1 };
            bytes[at..end].fill(value);
        }
        fix_checksum(&mut bytes);
        if let Ok(mut odometry) = Odometry::restore(&config(), true, &bytes) {
            let mut outcome = Outcome::default();
            let from = index_of(&DRIVE, 40);
            DRIVE[from..from + 120].iter().for_each(|input| input.push(&mut odometry, &mut outcome));
            odometry.finish(&mut outcome);
        }
    }
}

#[test]
fn values_at_every_byte_are_an_error_or_are_worked_with() {
    // The numbers, flags and lengths before the bulk: each byte.
    let saved = &SAVED[3];
    for at in (48..saved.len()).step_by(1 + saved.len() / 1500) {
        for value in [0, 0x7f, 0xff] {
            let mut bytes = saved.clone();
            bytes[at] = value;
            fix_checksum(&mut bytes);
            let _ = Odometry::restore(&config(), true, &bytes);
        }
    }
}

#[test]
fn another_build_or_configuration_is_refused_by_name() {
    let bytes = &SAVED[4];
    let refused = |result: Result<Odometry, Error>| result.unwrap_err().to_string();
    let mut other = config();
    other.odometry.ndt_weight += 1.0;
    let text = refused(Odometry::restore(&other, true, bytes));
    assert!(text.contains("another configuration"), "{text}");
    let text = refused(Odometry::restore(&config(), false, bytes));
    assert!(text.contains("another configuration"), "{text}");
    let mut other = bytes.clone();
    other[8] ^= 1;
    fix_checksum(&mut other);
    let text = refused(Odometry::restore(&config(), true, &other));
    assert!(text.contains("build of other source"), "{text}");
    let text = refused(Odometry::restore(&config(), true, b"something else"));
    assert!(text.contains("not a saved state"), "{text}");
}

#[test]
fn a_buffer_that_is_too_small_gives_an_error_with_what_is_needed() {
    let odometry = restore(&SAVED[4]);
    let needed = SAVED[4].len();
    let room = needed - 1;
    assert_eq!(
        odometry.save(&mut vec![0; room]),
        Err(Error::Room { needed, room })
    );
}

#[test]
fn a_pose_record_begins_a_new_frame_where_the_last_was_left() {
    let half = index_of(&DRIVE, 120) + 60;
    let mut odometry = Odometry::new(&config(), true);
    let mut before = Outcome::default();
    DRIVE[..half]
        .iter()
        .for_each(|input| input.push(&mut odometry, &mut before));
    let record = odometry.pose_record();
    let last = before.states.last().unwrap();
    assert_eq!(record.pose, last.pose);
    assert_eq!(record.stamp_ns, last.header.stamp_ns);
    assert_eq!(record.next_state, last.id + 1);

    let mut resumed = Odometry::resume(&config(), true, &record);
    let mut after = Outcome::default();
    DRIVE[half..]
        .iter()
        .for_each(|input| input.push(&mut resumed, &mut after));
    resumed.finish(&mut after);
    let first = &after.states[0];
    assert_eq!(first.pose, last.pose);
    assert_eq!(first.gyro_bias_rad_s, last.gyro_bias_rad_s);
    assert_eq!(first.id, last.id + 1);
    assert_eq!(first.odom_frame_id, last.odom_frame_id + 1);
    // The gap of the drive opens the next one, at its own origin.
    let frame = after
        .states
        .partition_point(|state| state.odom_frame_id == first.odom_frame_id);
    let third = &after.states[frame];
    assert_eq!(third.odom_frame_id, last.odom_frame_id + 2);
    assert_eq!(third.pose, [0.0; 3]);

    let keyframe = &after.keyframes[0].head;
    assert_eq!(keyframe.id, before.keyframes.last().unwrap().head.id + 1);
    for (kept, last) in keyframe.pose.iter().zip(last.pose) {
        assert!((kept - last).abs() < 1e-3, "{kept} {last}");
    }
    assert_eq!(keyframe.submap_root, keyframe.id);
    assert_eq!(keyframe.submap_id, record.next_submap);
    assert_eq!(after.keyframes[1].head.id, keyframe.id + 1);

    // It goes where the undisturbed one goes.
    let undisturbed = &UNDISTURBED.states[before.states.len()..];
    for (resumed, other) in after.states.iter().zip(undisturbed).take(frame) {
        let (a, b) = (resumed.pose, other.pose);
        let apart = ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt();
        assert!(apart < 0.15, "{apart} m apart at {}", other.id);
    }
    // Killed again before a scan: the pose is still known.
    let again = Odometry::resume(&config(), true, &record).pose_record();
    assert_eq!(again.pose, record.pose);
    assert_eq!(again.odom_frame_id, record.odom_frame_id + 1);
}

#[test]
fn a_hostile_pose_record_is_worked_with() {
    let mut record = restore(&SAVED[4]).pose_record();
    record.pose = [f64::NAN, f64::INFINITY, 1e300];
    record.gyro_bias_rad_s = [f64::NAN; 3];
    record.attitude = [0.0; 4];
    record.odom_frame_id = u64::MAX;
    record.next_state = u64::MAX;
    record.next_keyframe = u64::MAX;
    record.next_submap = u64::MAX;
    let mut odometry = Odometry::resume(&config(), true, &record);
    let mut outcome = Outcome::default();
    DRIVE[..600]
        .iter()
        .for_each(|input| input.push(&mut odometry, &mut outcome));
    odometry.finish(&mut outcome);
    assert!(outcome.states.iter().all(|state| state.pose[0].is_finite()));
}

#[test]
fn without_a_record_the_numbers_go_on_after_the_mappers() {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    let third = index_of(&DRIVE, 2) + 5;
    for (i, input) in DRIVE[..1500].iter().enumerate() {
        input.push(&mut odometry, &mut outcome);
        // Late, but before the first keyframe; and once more after it, which is of no effect.
        if i == third {
            assert!(outcome.keyframes.is_empty() && !outcome.states.is_empty());
            odometry.continue_after(70, 4);
        }
    }
    odometry.continue_after(900, 90);
    odometry.finish(&mut outcome);
    let heads = outcome.keyframes.iter().map(|keyframe| &keyframe.head);
    assert!(
        heads
            .clone()
            .map(|head| head.id)
            .eq(70..70 + heads.len() as u64)
    );
    assert!(
        heads
            .clone()
            .all(|head| head.odom_frame_id == 5 && head.submap_root == 70)
    );
}

#[test]
fn hostile_times_of_beams_do_no_harm() {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    for (i, input) in DRIVE[..500].iter().enumerate() {
        let mut input = input.clone();
        if let Input::Points(scan) = &mut input {
            let hostile = [i64::MIN, i64::MAX, 0][i % 3];
            scan.head
                .sweep
                .beams
                .iter_mut()
                .for_each(|beam| beam.stamp_ns = hostile);
            shift_scan(scan, 0);
        }
        input.push(&mut odometry, &mut outcome);
    }
    assert!(!outcome.states.is_empty());
}

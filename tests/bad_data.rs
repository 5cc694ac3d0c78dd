//! A good log with bad data in it: every scan that can have a pose has one, and the rest is
//! counted.

use crate::support::corrupt_inputs::{
    BAD, Ran, SCANS, corrupted, corrupted_with, scan, scan_index,
};
use crate::support::{drive, report};
use randt_messages::{MAX_RETURNS, Message, RadarScan};
use randt_simulator::Event;
use std::fs;

#[test]
fn the_drive_is_good_before_it_is_corrupted() {
    let ran = corrupted(|_| {});
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
}

#[test]
fn without_imu_every_scan_has_its_pose() {
    let ran = corrupted_with(&["--no-imu"], |_| {});
    ran.finished(0, SCANS);
    assert_eq!(report(&ran.out)["input"]["imu"], false);
    let without = corrupted(|events| events.retain(|event| !matches!(event, Event::Imu(_))));
    without.finished(0, SCANS);
    assert_eq!((ran.frames(), without.frames()), (1, 1));
    // The same scans and no sample: the same poses, asked for or not.
    let text = |ran: &Ran| fs::read_to_string(ran.out.join("odometry.tum")).unwrap();
    assert_eq!(text(&ran), text(&without));
}

#[test]
fn an_imu_that_stops_half_way_stops_nothing() {
    let ran = corrupted(|events| {
        let last = scan_index(events, BAD);
        let mut number = 0;
        events.retain(|event| {
            number += 1;
            number < last || !matches!(event, Event::Imu(_))
        });
    });
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
    let alone = ran.counter("odometry_scans_imu_late") + ran.counter("odometry_scans_without_imu");
    assert!(
        (SCANS - BAD - 2..=SCANS - BAD).contains(&(alone as usize)),
        "{alone} scans without IMU"
    );
}

#[test]
fn a_clock_that_is_set_back_opens_a_new_frame() {
    for seconds in [5, 3600] {
        let ran = corrupted(|events| {
            let from = scan_index(events, BAD - 1) + 1;
            events[from..]
                .iter_mut()
                .for_each(|event| drive::shift(event, -seconds * 1_000_000_000));
        });
        ran.finished(0, SCANS);
        assert_eq!(ran.frames(), 2, "set back by {seconds} s");
        assert_eq!(ran.counter("odometry_frames_reopened"), 1);
    }
}

#[test]
fn one_scan_with_a_stamp_of_another_time_leaves_the_others() {
    for by_ns in [
        -3_600_000_000_000,
        -3_000_000_000,
        -250_000_000,
        3_000_000_000,
        3_600_000_000_000,
    ] {
        let ran = corrupted(|events| {
            let index = scan_index(events, BAD);
            drive::shift(&mut events[index], by_ns);
        });
        let rows = ran.rows();
        assert!(
            rows.len() >= SCANS - 1,
            "{} scans, one stamped {by_ns} ns off",
            rows.len()
        );
        assert!((1..=3).contains(&ran.frames()));
    }
}

#[test]
fn stamps_at_the_ends_of_time_are_only_numbers() {
    for stamp_ns in [i64::MIN, i64::MIN + 1, -1, 0, 1, i64::MAX - 1, i64::MAX] {
        let ran = corrupted(|events| {
            let scan = scan(events, BAD);
            scan.head.header.stamp_ns = stamp_ns;
            (scan.head.sweep.begin_ns, scan.head.sweep.end_ns) = (stamp_ns, stamp_ns);
            let index = scan_index(events, BAD + 5);
            if let Event::Imu(sample) = &mut events[index + 1] {
                sample.header.stamp_ns = stamp_ns;
            }
        });
        assert!(
            ran.rows().len() >= SCANS - 1,
            "stamp {stamp_ns}: {}",
            ran.ended.stdout
        );
    }
    // A sweep as long as time itself.
    let ran = corrupted(|events| {
        let scan = scan(events, BAD);
        scan.head.sweep.begin_ns = i64::MIN;
    });
    assert!(ran.rows().len() >= SCANS - 1);
}

#[test]
fn a_scan_that_comes_twice_counts_once() {
    let ran = corrupted(|events| {
        let index = scan_index(events, BAD);
        let again = events[index].clone();
        events.insert(index + 1, again);
    });
    ran.finished(3, SCANS);
    assert_eq!(ran.counter("odometry_scans_repeated"), 1);
    assert!(
        ran.ended.stderr.contains("odometry_scans_repeated"),
        "{}",
        ran.ended.stderr
    );
    assert_eq!(ran.frames(), 1);
}

#[test]
fn values_that_are_no_numbers_are_left_out_and_the_rest_is_used() {
    let ran = corrupted(|events| {
        for (i, item) in scan(events, BAD).items.iter_mut().enumerate().step_by(3) {
            let wrong = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i / 3 % 3];
            if i % 2 == 0 {
                item.range_m = wrong
            } else {
                item.intensity = wrong
            }
        }
    });
    ran.finished(0, SCANS);
    assert!(ran.counter("returns_not_finite") > 1000);
    assert_eq!(ran.frames(), 1);

    let ran = corrupted(|events| {
        scan(events, BAD).head.sweep.beams[7].azimuth_rad = f32::NAN;
        scan(events, BAD + 3).head.sweep.azimuth_step_rad = f32::INFINITY;
    });
    ran.finished(3, SCANS - 2);
    assert_eq!((ran.counter("sweeps_malformed"), ran.frames()), (2, 1));

    let ran = corrupted(|events| {
        let from = scan_index(events, BAD);
        for (number, event) in events[from..].iter_mut().enumerate() {
            if let Event::Imu(sample) = event {
                let wrong = [f64::NAN, f64::INFINITY, -f64::INFINITY][number % 3];
                if number % 2 == 0 {
                    sample.rate_rad_s[number % 3] = wrong
                } else {
                    sample.acceleration_m_s2[1] = wrong
                }
            }
            if number == 30 {
                break;
            }
        }
    });
    ran.finished(3, SCANS);
    assert!(ran.counter("imu_samples_not_finite") > 20);
    assert_eq!(ran.frames(), 1);
}

#[test]
fn numbers_beyond_all_measure_do_no_harm() {
    let ran = corrupted(|events| {
        for (i, item) in scan(events, BAD).items.iter_mut().enumerate() {
            item.range_m = [f32::MAX, -f32::MAX, f32::MIN_POSITIVE, -0.0, 1e30][i % 5];
        }
        for item in &mut scan(events, BAD + 2).items {
            item.intensity = f32::MAX;
        }
        for (i, beam) in scan(events, BAD + 4)
            .head
            .sweep
            .beams
            .iter_mut()
            .enumerate()
        {
            beam.azimuth_rad = if i % 2 == 0 { f32::MAX } else { -1e20 };
            beam.stamp_ns = if i % 2 == 0 { i64::MAX } else { i64::MIN };
        }
        let from = scan_index(events, BAD + 6);
        for event in &mut events[from..from + 40] {
            if let Event::Imu(sample) = event {
                sample.rate_rad_s = [f64::MAX, -f64::MAX, 1e200];
                sample.acceleration_m_s2 = [-f64::MAX; 3];
            }
        }
    });
    assert!(ran.rows().len() >= SCANS - 4, "{}", ran.ended.stdout);
    assert!(
        ran.rows().iter().all(|row| row.pose.x_m.abs() < 1e3),
        "{:?}",
        ran.rows()
    );
}

#[test]
fn beams_out_of_order_are_still_beams() {
    // The table turned around: azimuths and times run backwards.
    let ran = corrupted(|events| {
        let sweep = &mut scan(events, BAD).head.sweep;
        let count = sweep.beam_count as usize;
        let turned: Vec<_> = sweep.beams[..count].iter().rev().copied().collect();
        for (beam, other) in sweep.beams.iter_mut().zip(turned) {
            (beam.azimuth_rad, beam.stamp_ns) = (other.azimuth_rad, other.stamp_ns);
        }
    });
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
    // A table whose beams do not own their returns.
    let ran = corrupted(|events| {
        scan(events, BAD).head.sweep.beams[..220].reverse();
        scan(events, BAD + 2).items.reverse();
        scan(events, BAD + 4).head.sweep.beam_count = u32::MAX;
        scan(events, BAD + 6).head.sweep.beams[0].first_return = 1;
    });
    ran.finished(3, SCANS - 4);
    assert_eq!((ran.counter("sweeps_malformed"), ran.frames()), (4, 1));
    assert!(ran.ended.stderr.contains("beam"), "{}", ran.ended.stderr);
}

#[test]
fn scans_with_nothing_or_one_beam_in_them_are_lived_through() {
    let empty = |scan: &mut Message<RadarScan>| {
        scan.items.clear();
        scan.head
            .sweep
            .beams
            .iter_mut()
            .for_each(|beam| beam.first_return = 0);
    };
    for number in [0, 1, BAD, SCANS - 1] {
        let ran = corrupted(|events| empty(scan(events, number)));
        // A first scan with nothing in it founds nothing; every other one has its pose from the
        // motion model.
        assert!(
            ran.rows().len() >= SCANS - 1,
            "scan {number} empty: {}",
            ran.ended.stdout
        );
        assert_eq!(ran.code(), 0, "{}", ran.ended.stderr);
    }
    let ran = corrupted(|events| {
        empty(scan(events, BAD));
        scan(events, BAD).head.sweep.beam_count = 0;
    });
    assert!(ran.rows().len() >= SCANS - 1);
    let ran = corrupted(|events| {
        let scan = scan(events, BAD);
        scan.items
            .truncate(scan.head.sweep.beams[1].first_return as usize);
        scan.head.sweep.beam_count = 1;
    });
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
    // Where every second one is empty there is nothing that a pose could follow from.
    let ran = corrupted(|events| {
        (0..SCANS)
            .step_by(2)
            .for_each(|number| empty(scan(events, number)));
    });
    assert_eq!(ran.code(), 3, "{}", ran.ended.stdout);
    assert!(ran.counter("scans_not_fitting") > SCANS as u64 / 2);
    // Nothing but empty scans is no good drive.
    let ran = corrupted(|events| (0..SCANS).for_each(|number| empty(scan(events, number))));
    assert!([1, 3].contains(&ran.code()), "{}", ran.ended.stderr);
}

#[test]
fn ten_times_the_points_are_only_more_points() {
    let ran = corrupted(|events| {
        for number in BAD..BAD + 5 {
            let scan = scan(events, number);
            let beams = scan.head.sweep.beam_count as usize;
            scan.items.clear();
            for beam in 0..beams {
                scan.head.sweep.beams[beam].first_return = scan.items.len() as u32;
                let room = (MAX_RETURNS - scan.items.len()) / (beams - beam);
                scan.items
                    .extend((0..room).map(|bin| randt_messages::Return {
                        range_m: 0.0161 * (bin as f32 + 20.0),
                        intensity: 10.0 + ((bin * 31 + beam * 7) % 17) as f32,
                        beam: beam as u16,
                        bin: bin as u16 + 20,
                    }));
            }
            assert_eq!(scan.items.len(), MAX_RETURNS);
        }
    });
    ran.finished(0, SCANS);
}

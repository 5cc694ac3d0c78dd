//! Broken, hostile and foreign inputs: every run ends soon, with a reason, and uses what is good.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

mod support;

use randt_messages::{MAX_RETURNS, Message, RadarScan};
use randt_simulator::Event;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use support::bag::{AS_PUBLISHED, Bag};
use support::{Ended, OUTPUTS, Random, Row, drive, names, recording, report, run, tum};

/// Scans of the drive that is spoilt: 2.5 s of standstill, then 5.5 s on the way.
const SCANS: usize = 40;
/// The scan at which things go wrong: on the way, with as many before as after.
const BAD: usize = 20;

static DRIVE: LazyLock<Vec<Event>> = LazyLock::new(|| drive::events(SCANS as u64));

/// A run and what it left.
struct Ran {
    ended: Ended,
    out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Ran {
    fn code(&self) -> i32 {
        self.ended.code.unwrap()
    }

    fn rows(&self) -> Vec<Row> {
        tum(&self.out.join("odometry.tum"))
    }

    fn counter(&self, name: &str) -> u64 {
        report(&self.out)["counters"][name]["count"]
            .as_u64()
            .unwrap_or(0)
    }

    /// Number of odometry frames.
    fn frames(&self) -> usize {
        self.rows().chunk_by(|a, b| a.frame == b.frame).count()
    }

    /// It finished with data lost, or without loss, and has a pose for so many scans.
    #[track_caller]
    fn finished(&self, code: i32, scans: usize) -> &Self {
        let Ended { stdout, stderr, .. } = &self.ended;
        assert_eq!(self.code(), code, "{stdout}{stderr}");
        assert_eq!(self.rows().len(), scans, "{stdout}{stderr}");
        self
    }

    #[track_caller]
    fn refused(&self, code: i32, words: &[&str]) -> &Self {
        assert_eq!(self.code(), code, "{}", self.ended.stderr);
        for words in words {
            assert!(
                self.ended.stderr.contains(words),
                "no {words:?} in: {}",
                self.ended.stderr
            );
        }
        self
    }
}

/// Runs an input and checks what holds for every one.
#[track_caller]
fn checked(input: &Path, more: &[&str]) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let ended = run(input, &out, more);
    let text = format!("{}{}", ended.stdout, ended.stderr);
    let code = ended
        .code
        .unwrap_or_else(|| panic!("{}: killed by a signal: {text}", input.display()));
    assert!([0, 1, 2, 3, 78].contains(&code), "exit code {code}: {text}");
    assert!(!ended.stderr.contains("panicked"), "{text}");
    // Whole files under their names or none at all, and nothing left lying about.
    let finished = code == 0 || code == 3;
    assert_eq!(
        names(&out),
        if finished { OUTPUTS.to_vec() } else { vec![] },
        "{text}"
    );
    let name = input.file_name().unwrap().to_str().unwrap();
    assert!(
        [0, 2, 78].contains(&code) || ended.stderr.contains(name),
        "{name} is not named: {text}"
    );
    if finished {
        let plot = fs::read_to_string(out.join("plot.svg")).unwrap();
        assert!(plot.trim_end().ends_with("</svg>"), "the picture is whole");
        // Every scan has a live pose and a final one.
        let [live, last] = ["odometry.tum", "trajectory.tum"].map(|name| tum(&out.join(name)));
        let stamps = |rows: &[Row]| rows.iter().map(|row| row.stamp_ns).collect::<Vec<_>>();
        assert_eq!(stamps(&live), stamps(&last));
    }
    Ran {
        ended,
        out,
        _folder: folder,
    }
}

/// Runs the simulated drive after it was spoilt.
#[track_caller]
fn spoilt(spoil: impl FnOnce(&mut Vec<Event>)) -> Ran {
    spoilt_with(&[], spoil)
}

#[track_caller]
fn spoilt_with(more: &[&str], spoil: impl FnOnce(&mut Vec<Event>)) -> Ran {
    let mut events = DRIVE.clone();
    spoil(&mut events);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&events, &log);
    checked(&log, more)
}

/// Place of a scan among the events.
fn place(events: &[Event], scan: usize) -> usize {
    let scans = events
        .iter()
        .enumerate()
        .filter(|(_, event)| matches!(event, Event::Scan(_)));
    scans.map(|(place, _)| place).nth(scan).unwrap()
}

fn scan(events: &mut [Event], number: usize) -> &mut Message<RadarScan> {
    let place = place(events, number);
    match &mut events[place] {
        Event::Scan(scan) => scan,
        other => panic!("{other:?}"),
    }
}

fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test]
fn the_drive_is_good_before_it_is_spoilt() {
    let ran = spoilt(|_| {});
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
}

#[test]
fn a_bag_that_is_cut_anywhere_gives_the_scans_before_the_cut() {
    let Some(path) = recording("bags/room.bag") else {
        return;
    };
    let bytes = fs::read(path).unwrap();
    // Ends of the first chunks, of six scans each.
    let chunks = [909_731, 1_812_579, 2_720_633];
    let seed = 20_260_731;
    println!("seed {seed}");
    let mut random = Random(seed);
    for trial in 0..12 {
        let cut = if trial == 0 {
            5
        } else {
            random.below(3_000_000)
        };
        let (_folder, path) = file("cut.bag", &bytes[..cut]);
        let ran = checked(&path, &[]);
        let whole = 6 * chunks.iter().filter(|end| **end <= cut).count();
        println!(
            "cut at byte {cut}: code {}, at least {whole} scans",
            ran.code()
        );
        if ran.code() == 1 {
            assert_eq!(whole, 0, "{}", ran.ended.stderr);
            continue;
        }
        assert_eq!(ran.code(), 3, "cut at byte {cut}: {}", ran.ended.stdout);
        assert!(
            ran.ended.stderr.contains("byte"),
            "no offset: {}",
            ran.ended.stderr
        );
        let rows = ran.rows();
        assert!(
            (whole..=whole + 6).contains(&rows.len()),
            "{} scans of {whole} whole ones",
            rows.len()
        );
        for (number, row) in rows.iter().enumerate() {
            assert_eq!(
                row.stamp_ns,
                1_700_000_000_200_000_000 + 200_000_000 * number as i64
            );
        }
    }
}

#[test]
fn what_has_no_radar_says_so() {
    for (name, words) in [
        ("no-messages.bag", "no radar"),
        ("example-bz2.bag", "no radar"),
        ("empty-file.bag", "0 bytes"),
    ] {
        let Some(path) = recording(&format!("bags/{name}")) else {
            return;
        };
        checked(&path, &[]).refused(1, &[name, words]);
    }
    let ran = spoilt(|events| events.retain(|event| !matches!(event, Event::Scan(_))));
    ran.refused(1, &["drive.mcap", "no radar"]);
}

#[test]
fn what_is_no_log_says_so() {
    let (_folder, path) = file("notes.txt", b"to be or not to be");
    checked(&path, &[]).refused(1, &["notes.txt", "to be or not", "expected"]);
    let folder = tempfile::tempdir().unwrap();
    checked(folder.path(), &[]).refused(1, &["without radar images"]);
    checked(&folder.path().join("absent.bag"), &[]).refused(1, &["absent.bag", "No such file"]);
    // Only the beginning of a log: no message yet.
    let (_folder, path) = file("begun.mcap", b"\x89MCAP0\r\n");
    checked(&path, &[]).refused(1, &["begun.mcap"]);
}

#[test]
fn without_imu_every_scan_has_its_pose() {
    let ran = spoilt_with(&["--no-imu"], |_| {});
    ran.finished(0, SCANS);
    assert_eq!(report(&ran.out)["input"]["imu"], false);
    let without = spoilt(|events| events.retain(|event| !matches!(event, Event::Imu(_))));
    without.finished(0, SCANS);
    assert_eq!((ran.frames(), without.frames()), (1, 1));
    // The same scans and no sample: the same poses, asked for or not.
    let text = |ran: &Ran| fs::read_to_string(ran.out.join("odometry.tum")).unwrap();
    assert_eq!(text(&ran), text(&without));
}

#[test]
fn an_imu_that_stops_half_way_stops_nothing() {
    let ran = spoilt(|events| {
        let last = place(events, BAD);
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
        let ran = spoilt(|events| {
            let from = place(events, BAD - 1) + 1;
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
        let ran = spoilt(|events| {
            let place = place(events, BAD);
            drive::shift(&mut events[place], by_ns);
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
        let ran = spoilt(|events| {
            let scan = scan(events, BAD);
            scan.head.header.stamp_ns = stamp_ns;
            (scan.head.sweep.begin_ns, scan.head.sweep.end_ns) = (stamp_ns, stamp_ns);
            let place = place(events, BAD + 5);
            if let Event::Imu(sample) = &mut events[place + 1] {
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
    let ran = spoilt(|events| {
        let scan = scan(events, BAD);
        scan.head.sweep.begin_ns = i64::MIN;
    });
    assert!(ran.rows().len() >= SCANS - 1);
}

#[test]
fn a_scan_that_comes_twice_counts_once() {
    let ran = spoilt(|events| {
        let place = place(events, BAD);
        let again = events[place].clone();
        events.insert(place + 1, again);
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
    let ran = spoilt(|events| {
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

    let ran = spoilt(|events| {
        scan(events, BAD).head.sweep.beams[7].azimuth_rad = f32::NAN;
        scan(events, BAD + 3).head.sweep.azimuth_step_rad = f32::INFINITY;
    });
    ran.finished(3, SCANS - 2);
    assert_eq!((ran.counter("sweeps_malformed"), ran.frames()), (2, 1));

    let ran = spoilt(|events| {
        let from = place(events, BAD);
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
    let ran = spoilt(|events| {
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
        let from = place(events, BAD + 6);
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
    let ran = spoilt(|events| {
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
    let ran = spoilt(|events| {
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
        let ran = spoilt(|events| empty(scan(events, number)));
        // A first scan with nothing in it founds nothing; every other one has its pose from the motion model.
        assert!(
            ran.rows().len() >= SCANS - 1,
            "scan {number} empty: {}",
            ran.ended.stdout
        );
        assert_eq!(ran.code(), 0, "{}", ran.ended.stderr);
    }
    let ran = spoilt(|events| {
        empty(scan(events, BAD));
        scan(events, BAD).head.sweep.beam_count = 0;
    });
    assert!(ran.rows().len() >= SCANS - 1);
    let ran = spoilt(|events| {
        let scan = scan(events, BAD);
        scan.items
            .truncate(scan.head.sweep.beams[1].first_return as usize);
        scan.head.sweep.beam_count = 1;
    });
    ran.finished(0, SCANS);
    assert_eq!(ran.frames(), 1);
    // Nothing but empty scans.
    let ran = spoilt(|events| (0..SCANS).for_each(|number| empty(scan(events, number))));
    assert!([0, 1].contains(&ran.code()), "{}", ran.ended.stderr);
}

#[test]
fn ten_times_the_points_are_only_more_points() {
    let ran = spoilt(|events| {
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

#[test]
fn a_bags_clouds_may_be_shuffled_spoilt_empty_or_far_too_large() {
    let Some(path) = recording("bags/room.bag") else {
        return;
    };
    let ran = |change: &dyn Fn(usize, &mut support::bag::Cloud)| {
        let mut bag = Bag::read(&path, 30);
        bag.rewrite(&AS_PUBLISHED, |number, cloud| change(number, cloud));
        let (_folder, copy) = file("room.bag", &bag.written());
        checked(&copy, &[])
    };
    let bad = 15;
    let good = ran(&|_, _| {});
    good.finished(0, 30);

    // Points in any order are the same sweep.
    let shuffled = ran(&|number, cloud| {
        let mut random = Random(number as u64);
        for i in (1..cloud.points.len()).rev() {
            cloud.points.swap(i, random.below(i + 1));
        }
    });
    shuffled.finished(0, 30);
    assert_eq!(shuffled.frames(), 1);
    for (a, b) in shuffled.rows().iter().zip(good.rows()) {
        assert!(
            (a.pose.translation() - b.pose.translation()).norm() < 0.02,
            "{a:?} {b:?}"
        );
    }

    let spoilt = ran(&|number, cloud| {
        if number == bad {
            let wrong = [f32::NAN, f32::INFINITY, f32::MAX, f32::NEG_INFINITY];
            cloud
                .points
                .iter_mut()
                .enumerate()
                .step_by(4)
                .for_each(|(i, point)| point[i / 4 % 4] = wrong[i / 16 % 4]);
        }
    });
    assert_eq!(
        (spoilt.rows().len(), spoilt.frames()),
        (30, 1),
        "{}",
        spoilt.ended.stdout
    );
    assert!(spoilt.counter("returns_not_finite") > 1000);

    let empty = ran(&|number, cloud| {
        if number == bad {
            cloud.points.clear();
        }
        if number == bad + 3 {
            cloud.points.truncate(1);
        }
    });
    assert_eq!(
        (empty.rows().len(), empty.frames()),
        (30, 1),
        "{}",
        empty.ended.stdout
    );

    let large = ran(&|number, cloud| {
        if number == bad {
            cloud.points = (0..10).flat_map(|_| cloud.points.clone()).collect();
        }
    });
    assert_eq!(
        (large.rows().len(), large.frames()),
        (30, 1),
        "{}",
        large.ended.stdout
    );
}

/// The Oxford folder, its images by links.
fn oxford() -> Option<(tempfile::TempDir, PathBuf)> {
    let original = recording("radar/oxford")?;
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("oxford");
    fs::create_dir_all(copy.join("radar")).unwrap();
    fs::copy(
        original.join("radar.timestamps"),
        copy.join("radar.timestamps"),
    )
    .unwrap();
    for name in names(&original.join("radar")) {
        let target = fs::canonicalize(original.join("radar").join(&name)).unwrap();
        std::os::unix::fs::symlink(target, copy.join("radar").join(name)).unwrap();
    }
    Some((folder, copy))
}

/// One grey pixel.
const FOREIGN_PNG: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0\x3a\x7e\x9b\x55\
\0\0\0\x0aIDATx\x9cc`\0\0\0\x02\0\x01\x48\xaf\xa4\x71\0\0\0\0IEND\xae\x42\x60\x82";

#[test]
fn foreign_and_broken_images_in_a_folder_are_stepped_over_by_name() {
    let Some((_folder, oxford)) = oxford() else {
        return;
    };
    let foreign = "1547131047356000";
    let list = oxford.join("radar.timestamps");
    let stamps = fs::read_to_string(&list).unwrap();
    let stamps = stamps.replacen(
        "1547131047356527 1\n",
        &format!("{foreign} 1\n1547131047356527 1\n"),
        1,
    );
    fs::write(&list, &stamps).unwrap();
    let image = oxford.join("radar").join(foreign).with_extension("png");
    for bytes in [FOREIGN_PNG, b"", b"not a picture", &FOREIGN_PNG[..40]] {
        fs::write(&image, bytes).unwrap();
        let ran = checked(&oxford, &["--profile", "oxford"]);
        ran.finished(3, 11);
        assert_eq!((ran.counter("images_unreadable"), ran.frames()), (1, 1));
        assert!(
            ran.ended.stderr.contains(&format!("{foreign}.png")),
            "{}",
            ran.ended.stderr
        );
    }
    // Named in the list and absent.
    fs::remove_file(&image).unwrap();
    let ran = checked(&oxford, &["--profile", "oxford"]);
    ran.finished(3, 11);
    assert!(ran.ended.stderr.contains("line 5"), "{}", ran.ended.stderr);
    checked(&oxford.join("radar.timestamps"), &[]).refused(1, &["radar.timestamps", "expected"]);
}

#[test]
fn frames_on_both_sides_of_a_gap_are_never_spliced() {
    let Some((_folder, oxford)) = oxford() else {
        return;
    };
    let ran = checked(&oxford, &["--profile", "oxford", "--all-images"]);
    ran.finished(0, 13);
    let rows = ran.rows();
    assert_eq!(
        rows.iter().filter(|row| row.frame == rows[0].frame).count(),
        11
    );
    assert_eq!(ran.frames(), 2);
    // The new frame begins at its own origin, and is told.
    assert!(rows[11].pose.translation().norm() < 3.0, "{:?}", rows[11]);
    assert!(
        ran.ended.stdout.contains("2 odometry frames"),
        "{}",
        ran.ended.stdout
    );
    assert_eq!(report(&ran.out)["frames"].as_array().unwrap().len(), 2);
}

#[test]
fn where_nothing_can_be_written_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&DRIVE, &log);
    let taken = folder.path().join("taken");
    fs::write(&taken, "mine").unwrap();
    for out in [taken.clone(), taken.join("below")] {
        let ended = run(&log, &out, &[]);
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(
            ended.stderr.contains(out.to_str().unwrap()),
            "{}",
            ended.stderr
        );
    }
    assert_eq!(fs::read_to_string(&taken).unwrap(), "mine");
    // A folder stands where a file should be.
    let out = folder.path().join("out");
    fs::create_dir_all(out.join("plot.svg")).unwrap();
    let ended = run(&log, &out, &[]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("plot.svg"), "{}", ended.stderr);
    assert!(
        names(&out)
            .iter()
            .all(|name| !name.ends_with(".part") && name != "report.json"),
        "{:?}",
        names(&out)
    );
    assert_eq!(names(folder.path()), ["drive.mcap", "out", "taken"]);
}

#[test]
fn keys_and_sensors_that_do_not_fit_are_refused_before_the_work() {
    spoilt_with(&["--set", "odometry.windw=3"], |_| {}).refused(78, &["windw", "window"]);
    spoilt_with(&["--set", "odometry.window=many"], |_| {}).refused(78, &["window"]);
    spoilt_with(&["--set", "odometry.window=-3"], |_| {}).refused(78, &["window"]);
    spoilt_with(&["--profile", "absent.toml"], |_| {}).refused(78, &["absent.toml"]);
    spoilt_with(&["--sensor", "lidar"], |_| {}).refused(78, &["lidar"]);
    spoilt_with(&["--sensor", "navtech-cts"], |_| {})
        .refused(78, &["navtech-cts", "range_resolution_m"]);
    spoilt_with(&["--speed", "fast"], |_| {}).refused(2, &["--speed"]);
    let Some(path) = recording("bags/room.bag") else {
        return;
    };
    checked(&path, &["--sensor", "navtech-cts"]).refused(78, &["navtech-cts"]);
}

#[test]
fn a_log_that_is_cut_gives_the_scans_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&DRIVE, &log);
    let bytes = fs::read(&log).unwrap();
    let seed = 20_260_732;
    println!("seed {seed}");
    let mut random = Random(seed);
    let mut best = 0;
    for _ in 0..8 {
        let cut = random.below(bytes.len() - 1);
        let (_folder, path) = file("cut.mcap", &bytes[..cut]);
        let ran = checked(&path, &[]);
        assert!(
            [1, 3].contains(&ran.code()),
            "cut at byte {cut}: {}",
            ran.ended.stdout
        );
        if ran.code() == 3 {
            best = best.max(ran.rows().len());
            assert!(
                ran.ended.stderr.contains("byte"),
                "no offset: {}",
                ran.ended.stderr
            );
        }
    }
    assert!(best > SCANS / 3, "{best} scans at most");
}

//! Broken and foreign files: every run ends soon, with a reason, and uses what is good.

use crate::support::bag::{AS_PUBLISHED, Bag};
use crate::support::corrupt_inputs::{DRIVE, SCANS, checked, corrupted, corrupted_with, file};
use crate::support::{OUTPUTS, Random, drive, names, recording, report, run};
use randt_simulator::Event;
use std::fs;
use std::path::PathBuf;

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
fn what_has_no_radar_is_refused_by_name() {
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
    let ran = corrupted(|events| events.retain(|event| !matches!(event, Event::Scan(_))));
    ran.refused(1, &["drive.mcap", "no radar"]);
}

#[test]
fn what_is_no_log_is_refused_by_name() {
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
fn a_bags_clouds_may_be_shuffled_corrupted_empty_or_far_too_large() {
    let Some(path) = recording("bags/room.bag") else {
        return;
    };
    let ran = |change: &dyn Fn(usize, &mut crate::support::bag::Cloud)| {
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

    let corrupted = ran(&|number, cloud| {
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
        (corrupted.rows().len(), corrupted.frames()),
        (30, 1),
        "{}",
        corrupted.ended.stdout
    );
    assert!(corrupted.counter("returns_not_finite") > 1000);

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
    // A folder is where a file should be: the others are written, and the report names the one
    // that is not.
    let out = folder.path().join("out");
    fs::create_dir_all(out.join("plot.svg")).unwrap();
    let ended = run(&log, &out, &[]);
    assert_eq!(ended.code, Some(3), "{}", ended.stderr);
    assert!(ended.stderr.contains("plot.svg"), "{}", ended.stderr);
    assert_eq!(names(&out), OUTPUTS);
    assert!(out.join("plot.svg").is_dir());
    let lost = &report(&out)["counters"]["files_not_written"];
    assert!(
        lost["first"].as_str().unwrap().contains("plot.svg"),
        "{lost}"
    );
    // Nothing records what happened where the report cannot be written.
    let out = folder.path().join("without");
    fs::create_dir_all(out.join("report.json")).unwrap();
    let ended = run(&log, &out, &[]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("report.json"), "{}", ended.stderr);
    assert!(out.join("trajectory.tum").is_file());
    fs::remove_dir_all(out).unwrap();
    assert_eq!(names(folder.path()), ["drive.mcap", "out", "taken"]);
}

#[test]
fn keys_and_sensors_that_do_not_fit_are_refused_before_the_work() {
    corrupted_with(&["--set", "odometry.windw=3"], |_| {}).refused(78, &["windw", "window"]);
    corrupted_with(&["--set", "odometry.window=many"], |_| {}).refused(78, &["window"]);
    corrupted_with(&["--set", "odometry.window=-3"], |_| {}).refused(78, &["window"]);
    corrupted_with(&["--profile", "absent.toml"], |_| {}).refused(78, &["absent.toml"]);
    corrupted_with(&["--sensor", "lidar"], |_| {}).refused(78, &["lidar"]);
    corrupted_with(&["--sensor", "navtech-cts"], |_| {})
        .refused(78, &["navtech-cts", "range_resolution_m"]);
    corrupted_with(&["--speed", "fast"], |_| {}).refused(2, &["--speed"]);
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
    // The new frame begins at its own origin, and is reported.
    assert!(rows[11].pose.translation().norm() < 3.0, "{:?}", rows[11]);
    assert!(
        ran.ended.stdout.contains("2 odometry frames"),
        "{}",
        ran.ended.stdout
    );
    assert_eq!(report(&ran.out)["frames"].as_array().unwrap().len(), 2);
}

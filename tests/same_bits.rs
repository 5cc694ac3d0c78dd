//! One binary gives the same bytes in every run, whatever the folder, the core or the machine's
//! vector units.

use crate::support::bag::{AS_PUBLISHED, Bag, Layout};
use crate::support::{Ended, OUTPUTS, ended, l_shaped_world, names, randt, recording, report, run};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::SystemTime;

/// What a run wrote, the report's times left out.
fn outputs(ended: &Ended, folder: &Path) -> Vec<(&'static str, Vec<u8>)> {
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let mut found = names(folder);
    // What was there before.
    found.retain(|name| name != "before-1");
    assert_eq!(found, OUTPUTS);
    let bytes = |name: &'static str| match name {
        "report.json" => (name, report(folder).to_string().into_bytes()),
        _ => (name, fs::read(folder.join(name)).unwrap()),
    };
    OUTPUTS.map(bytes).into()
}

fn assert_same(found: &[(&'static str, Vec<u8>)], expected: &[(&'static str, Vec<u8>)], how: &str) {
    for ((name, found), (_, expected)) in found.iter().zip(expected) {
        let differs = found.iter().zip(expected).position(|(a, b)| a != b);
        assert!(
            found == expected,
            "{how}: {name}: first difference at byte {differs:?}"
        );
    }
}

/// Runs an input in every way that may not matter.
fn check_every_way(input: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let first = run(input, &at("first"), &[]);
    let expected = outputs(&first, &at("first"));
    assert_no_date(&expected);

    assert_same(
        &outputs(&run(input, &at("first"), &[]), &at("first")),
        &expected,
        "written once more",
    );
    let kept = outputs(&first, &at("first").join("before-1"));
    assert_same(&kept, &expected, "kept");

    // The same file by another path, from another working folder.
    let elsewhere = at("another folder");
    fs::create_dir(&elsewhere).unwrap();
    let name = input.file_name().unwrap();
    std::os::unix::fs::symlink(fs::canonicalize(input).unwrap(), elsewhere.join(name)).unwrap();
    let mut command = randt(&["run", "--out", "out"]);
    command.arg(name).current_dir(&elsewhere);
    assert_same(
        &outputs(&ended(command), &elsewhere.join("out")),
        &expected,
        "in another folder",
    );

    let mut command = Command::new("taskset");
    command.args(["-c", "0", env!("CARGO_BIN_EXE_randt"), "run"]);
    command.arg(input).arg("--out").arg(at("one core"));
    assert_same(
        &outputs(&ended(command), &at("one core")),
        &expected,
        "on one core",
    );

    // The platform's library takes other code paths on machines without these units; ours must not
    // care.
    let mut command = randt(&["run"]);
    command.arg(input).arg("--out").arg(at("old machine"));
    command.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX");
    assert_same(
        &outputs(&ended(command), &at("old machine")),
        &expected,
        "without vector units",
    );
}

/// No output has the time at which it was made.
fn assert_no_date(outputs: &[(&'static str, Vec<u8>)]) {
    let since_1970 = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap();
    // Good to a day, and for a century.
    let year = 1970 + (since_1970.as_secs() as f64 / 86_400.0 / 365.2425) as u64;
    for separator in ["-", "/", "."] {
        for month in 1..=12 {
            let date = format!("{year}{separator}{month:02}{separator}");
            for (name, bytes) in outputs {
                let text = String::from_utf8_lossy(bytes);
                assert!(!text.contains(&date), "{date} in {name}");
            }
        }
    }
}

#[test]
fn a_simulated_log_and_its_map_are_the_same_bytes_every_way() {
    let folder = tempfile::tempdir().unwrap();
    let [log, again] = ["one", "two"].map(|name| {
        let folder = folder.path().join(name);
        fs::create_dir(&folder).unwrap();
        l_shaped_world::drive(&folder).0
    });
    assert!(
        fs::read(&log).unwrap() == fs::read(again).unwrap(),
        "one seed, one log"
    );
    // Without loops in the graph the final poses would only be odometry's.
    let out = folder.path().join("out");
    run(&log, &out, &[]);
    let accepted = &report(&out)["loops"]["statuses"]["accepted"];
    println!("{accepted} loops");
    assert!(accepted.as_u64().unwrap() > 0);
    check_every_way(&log);
}

#[test]
fn a_recording_gives_the_same_bytes_every_way() {
    let Some(bag) = recording("bags/room.bag") else {
        return;
    };
    check_every_way(&bag);
}

#[test]
fn the_same_bag_laid_out_otherwise_gives_the_same_trajectory() {
    let Some(path) = recording("bags/room.bag") else {
        return;
    };
    let wide = Layout {
        step: 32,
        offsets: [16, 24, 4, 8],
        big_endian: true,
        row_padding: 5,
    };
    let folder = tempfile::tempdir().unwrap();
    let trajectory = |name: &str, layout: &Layout| {
        let mut bag = Bag::read(&path, 60);
        bag.rewrite(layout, |_, _| {});
        let copy = folder.path().join(name).with_extension("bag");
        fs::write(&copy, bag.written()).unwrap();
        let out = folder.path().join(name);
        let ended = run(&copy, &out, &[]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        fs::read_to_string(out.join("odometry.tum")).unwrap()
    };
    let expected = trajectory("published", &AS_PUBLISHED);
    assert_eq!(expected.lines().count(), 61, "a comment and 60 rows");
    assert_eq!(trajectory("wide", &wide), expected);

    // The copy stands for its original: the live pose of a scan knows nothing of those after it.
    let out = folder.path().join("whole");
    run(&path, &out, &[]);
    let whole = fs::read_to_string(out.join("odometry.tum")).unwrap();
    // The last scans of the copy end without the IMU sample after them.
    let lines = expected.lines().count() - 2;
    assert!(
        whole.lines().take(lines).eq(expected.lines().take(lines)),
        "the copy differs from its original"
    );
}

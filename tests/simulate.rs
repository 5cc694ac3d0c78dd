//! `randt simulate` as a user calls it.

use randt_log::LogReader;
use randt_messages::{RadarScan, TruthPoseTopic};
use randt_simulator::World;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn simulate(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_randt"))
        .arg("simulate")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

#[test]
fn the_same_seed_writes_the_same_bytes_and_another_seed_others() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, seed: &str| {
        let output = simulate(
            folder.path(),
            &["building", "--out", name, "--scans", "20", "--seed", seed],
        );
        assert!(output.status.success(), "{}", stderr(&output));
        fs::read(folder.path().join(name)).unwrap()
    };
    let first = write("a.mcap", "7");
    assert!(first == write("b.mcap", "7"));
    assert!(first != write("c.mcap", "8"));
    // Nothing but the three logs is left.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn it_prints_what_it_wrote_and_the_log_holds_it() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "building",
        "--out",
        "drive.mcap",
        "--scans",
        "30",
        "--truth",
        "truth.tum",
    ];
    let output = simulate(folder.path(), &arguments);
    let printed = str::from_utf8(&output.stdout).unwrap();
    assert!(
        printed.starts_with("drive.mcap: 30 sweeps, 6.1 s, "),
        "{printed}"
    );
    let mut reader = LogReader::open(&folder.path().join("drive.mcap")).unwrap();
    let robot = reader.robot().unwrap();
    assert_eq!(robot.radar, Some([0.12, 0.0, 0.0]));
    let mut truths = Vec::new();
    let mut scans = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        truths.extend(
            entry
                .decode::<TruthPoseTopic>()
                .unwrap()
                .map(|truth| *truth.head),
        );
        scans.extend(
            entry
                .decode::<RadarScan>()
                .unwrap()
                .map(|scan| scan.head.header.stamp_ns),
        );
    }
    assert_eq!(scans.len(), 30);
    // Each sweep's end has its truth, in the log and in the file.
    let rows = fs::read_to_string(folder.path().join("truth.tum")).unwrap();
    assert_eq!(rows.lines().count(), 30);
    for (row, stamp_ns) in rows.lines().zip(scans) {
        let truth = truths
            .iter()
            .find(|truth| truth.header.stamp_ns == stamp_ns)
            .unwrap();
        let words: Vec<&str> = row.split(' ').collect();
        assert_eq!(words.len(), 8);
        assert_eq!(words[0].replace('.', "").parse(), Ok(stamp_ns));
        assert!((words[1].parse::<f64>().unwrap() - truth.pose[0]).abs() < 1e-8);
    }
}

#[test]
fn a_world_of_ones_own_is_driven_or_its_mistake_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.world");
    let room = "wall concrete 0,0 9,0 9,6 0,6 0,0\nroute 2,2 7,2 7,4 2,4\n";
    fs::write(&path, room).unwrap();
    let arguments = ["--world", "room.world", "--out", "a.mcap", "--scans", "3"];
    let output = simulate(folder.path(), &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(LogReader::open(&folder.path().join("a.mcap")).is_ok());

    fs::write(&path, format!("{room}post wool 1,1 0.2\n")).unwrap();
    let output = simulate(folder.path(), &[&arguments[..], &["--force"]].concat());
    assert_eq!(output.status.code(), Some(1));
    let printed =
        "room.world: line 3: \"wool\": expected one of concrete, plaster, wood, glass, metal";
    assert!(stderr(&output).contains(printed), "{}", stderr(&output));
}

#[test]
fn the_help_names_the_number_of_sweeps_of_two_laps() {
    let folder = tempfile::tempdir().unwrap();
    let output = simulate(folder.path(), &["--help"]);
    let help = str::from_utf8(&output.stdout).unwrap();
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for name in World::NAMES {
        let sweeps = World::named(name).unwrap().sweeps();
        assert!(help.contains(&format!("{name} {sweeps}")), "{help}");
    }
}

#[test]
fn without_a_number_of_sweeps_a_drive_goes_round_twice() {
    let folder = tempfile::tempdir().unwrap();
    let room = "wall concrete 0,0 9,0 9,6 0,6 0,0\nroute 2,2 7,2 7,4 2,4\n";
    fs::write(folder.path().join("room.world"), room).unwrap();
    let output = simulate(folder.path(), &["--world", "room.world", "--out", "a.mcap"]);
    let printed = str::from_utf8(&output.stdout).unwrap();
    let driven_m = printed
        .split(", ")
        .nth(2)
        .unwrap()
        .trim_end_matches(" m driven");
    let driven_m: f64 = driven_m.parse().unwrap();
    // A lap is 14 m, less its rounded corners.
    assert!((22.0..40.0).contains(&driven_m), "{printed}");
}

#[test]
fn a_file_that_exists_is_kept_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("drive.mcap"), "precious").unwrap();
    let arguments = ["building", "--out", "drive.mcap", "--scans", "1"];
    let output = simulate(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("drive.mcap: exists already"),
        "{}",
        stderr(&output)
    );
    assert_eq!(
        fs::read(folder.path().join("drive.mcap")).unwrap(),
        b"precious"
    );
    let output = simulate(folder.path(), &[&arguments[..], &["--force"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(LogReader::open(&folder.path().join("drive.mcap")).is_ok());
}

#[test]
fn wrong_arguments_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, code, printed) in [
        (
            &["castle", "--out", "a.mcap"][..],
            1,
            "unknown world \"castle\": there is building, yard, tunnel; a file's goes to --world",
        ),
        (&["--world", "no.world", "--out", "a.mcap"], 1, "no.world"),
        (
            &["building", "--world", "no.world", "--out", "a.mcap"],
            2,
            "cannot be used with",
        ),
        (&["--out", "a.mcap"], 2, "<WORLD|--world <FILE>>"),
        (
            &["building", "--out", "no/such/a.mcap"],
            1,
            "no/such/a.mcap.active",
        ),
        (
            &["building", "--out", "a.mcap", "--scans", "0"],
            2,
            "--scans",
        ),
        (&["building"], 2, "--out"),
    ] {
        let output = simulate(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(stderr(&output).contains(printed), "{}", stderr(&output));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

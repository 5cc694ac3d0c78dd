//! `randt config` as a user calls it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn randt(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_randt"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> &str {
    str::from_utf8(&output.stdout).unwrap()
}

fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

#[test]
fn what_show_prints_can_be_given_back_as_a_profile() {
    let folder = tempfile::tempdir().unwrap();
    let shown = randt(
        folder.path(),
        &[
            "config",
            "show",
            "--profile",
            "indoor",
            "--sensor",
            "navtech-cts",
            "--set",
            "odometry.window=4",
        ],
    );
    assert!(shown.status.success(), "{}", stderr(&shown));
    let text = stdout(&shown);
    assert!(
        text.contains("cell_size_m = 0.5  # config/indoor.toml:"),
        "{text}"
    );
    assert!(
        text.contains("name = \"navtech-cts\"  # config/sensors/navtech-cts.toml:"),
        "{text}"
    );
    assert!(text.contains("window = 4  # --set"), "{text}");
    assert!(text.contains("deskew = true  # default"), "{text}");

    fs::write(folder.path().join("mine.toml"), text).unwrap();
    let checked = randt(folder.path(), &["config", "check", "mine.toml"]);
    assert_eq!(stdout(&checked), "mine.toml: good\n");
    let again = randt(folder.path(), &["config", "show", "--profile", "mine.toml"]);
    let values = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split("  # ").next().unwrap().to_owned())
            .collect()
    };
    assert_eq!(values(stdout(&again)), values(text));
}

#[test]
fn every_shipped_file_is_good() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let checked = randt(
        &config,
        &[
            "config",
            "check",
            "mixed.toml",
            "indoor.toml",
            "outdoor.toml",
            "oxford.toml",
            "robot.toml",
            "sensors/isdr-c.toml",
            "sensors/navtech-cts.toml",
        ],
    );
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
}

#[test]
fn a_bad_configuration_ends_with_78_and_names_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("bad.toml"),
        "[ndt]\ncell_size = 1.0\n\n[odometry]\nwindow = 0\n",
    )
    .unwrap();
    fs::write(
        folder.path().join("far.toml"),
        "[odometry]\nspeed_max_m_s = 1e300\n[keyframe]\ndistance_m = 1e9\n[sensor]\nperiod_s = 1e12\n",
    )
    .unwrap();
    fs::write(folder.path().join("cut.toml"), "[ndt\n").unwrap();
    fs::write(folder.path().join("bytes.toml"), b"[ndt]\n\xff\xfe\n").unwrap();

    for (arguments, words) in [
        (
            &["config", "check", "bad.toml"][..],
            &[
                "bad.toml:2: unknown key \"ndt.cell_size\"; did you mean \"ndt.cell_size_m\"?",
                "bad.toml:5: odometry.window is 0, it must be from 1 to 20",
            ][..],
        ),
        (&["config", "check", "cut.toml"], &["cut.toml:1: "]),
        (
            &["config", "check", "bytes.toml"],
            &["bytes.toml:2: not UTF-8"],
        ),
        (
            &["config", "check", "absent.toml"],
            &["absent.toml: No such file"],
        ),
        (
            &["config", "show", "--profile", "bad.toml"],
            &["2 mistakes"],
        ),
        (
            &["config", "show", "--profile", "outdor"],
            &["did you mean \"outdoor\"?"],
        ),
        (
            &["config", "show", "--sensor", "navtech"],
            &["did you mean \"navtech-cts\"?"],
        ),
        (
            &["config", "show", "--robot", "bad.toml"],
            &["[ndt] does not belong in a robot file"],
        ),
        (
            &["config", "show", "--set", "ndt.cell_size_m=wide"],
            &["wide, it must be a number"],
        ),
        (&["config", "show", "--profile", "."], &["Is a directory"]),
        // Each of these asked for more memory than there is.
        (
            &["config", "check", "far.toml"],
            &[
                "far.toml:2: odometry.speed_max_m_s is 1e300, it must be from 0.1 to 100 (",
                "far.toml:4: keyframe.distance_m is 1e9, it must be from 0.02 to 50 (",
                "far.toml:6: sensor.period_s is 1e12, it must be from 0.01 to 10 (",
            ],
        ),
        (
            &[
                "config",
                "show",
                "--set",
                "ndt.cell_size_m=0.05",
                "--set",
                "sensor.range_max_m=200",
            ],
            &["ndt.cell_size_m = 0.05 (--set) together make a scan's grid of this many squares"],
        ),
    ] {
        let output = randt(folder.path(), arguments);
        assert_eq!(
            output.status.code(),
            Some(78),
            "{arguments:?}: {}",
            stderr(&output)
        );
        for words in words {
            assert!(
                stderr(&output).contains(words),
                "{arguments:?}: {}",
                stderr(&output)
            );
        }
        assert!(stdout(&output).is_empty());
    }
}

#[test]
fn wrong_usage_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["config"][..],
        &["config", "check"],
        &["config", "show", "--profil", "x"],
    ] {
        let output = randt(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

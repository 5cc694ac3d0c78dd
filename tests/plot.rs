//! `randt plot`: which pictures it draws of which logs, and how it names those that it does not.

use crate::support::pipeline::log;
use crate::support::{Ended, ended, names, randt, recorded};
use randt_log::{LogFile, Options};
use std::fs;
use std::path::Path;

/// All that there are.
const PICTURES: [&str; 6] = [
    "biases.svg",
    "latency.svg",
    "motion.svg",
    "path.svg",
    "quality.svg",
    "topics.svg",
];

fn plot(file: &Path, out: &Path) -> Ended {
    let mut command = randt(&["plot"]);
    command.arg(file).arg("--out").arg(out);
    ended(command)
}

fn picture(out: &Path, name: &str) -> String {
    fs::read_to_string(out.join(name)).unwrap()
}

#[test]
fn a_recorded_run_has_every_picture() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("run.mcap");
    recorded::write(120, &input);
    let out = folder.path().join("pictures");
    let drawn = plot(&input, &out);
    assert_eq!((drawn.code, drawn.stderr.as_str()), (Some(0), ""));
    assert_eq!(names(&out), PICTURES);
    for name in PICTURES {
        let path = out.join(name).display().to_string();
        assert!(drawn.stdout.contains(&path), "{}", drawn.stdout);
        let svg = picture(&out, name);
        assert!(
            svg.contains("run.mcap: ") && svg.contains("</svg>"),
            "{name}"
        );
        assert!(!svg.contains("no data"), "{name}");
    }
    for (name, words) in [
        ("path.svg", ["live", "estimate", "returns"]),
        ("motion.svg", ["speed, m/s", "yaw rate, deg/s", "gyro"]),
        (
            "quality.svg",
            ["counterpart", "worst direction", "NDT cells"],
        ),
        ("latency.svg", ["wait: ", "compute: ", ", ms"]),
        (
            "topics.svg",
            ["imu/sample/v1, Hz", "7 not recorded", "not recorded"],
        ),
        ("biases.svg", ["deg/s", "roll", "pitch"]),
    ] {
        let svg = picture(&out, name);
        for words in words {
            assert!(svg.contains(words), "{name}: {words}");
        }
    }
    // The same log gives the same pictures.
    let before = PICTURES.map(|name| picture(&out, name));
    assert_eq!(plot(&input, &out).code, Some(0));
    assert_eq!(PICTURES.map(|name| picture(&out, name)), before);

    // As a kill leaves it: up to the cut, and that is reported. Where no folder is given, it is
    // named after the log.
    let cut = folder.path().join("cut.mcap.active");
    let bytes = fs::read(&input).unwrap();
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let mut command = randt(&["plot"]);
    command.arg(&cut);
    let drawn = ended(command);
    assert_eq!(drawn.code, Some(3), "{}", drawn.stderr);
    assert!(drawn.stderr_contains("stepped over"), "{}", drawn.stderr);
    assert_eq!(names(&folder.path().join("cut.mcap.plots")), PICTURES);
}

#[test]
fn of_a_log_of_sensors_what_is_in_it_is_drawn_and_the_rest_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 20);
    let out = folder.path().join("pictures");
    // From an earlier log.
    fs::create_dir(&out).unwrap();
    fs::write(out.join("latency.svg"), "another drive's").unwrap();
    let drawn = plot(&input, &out);
    assert_eq!(drawn.code, Some(0), "{}", drawn.stderr);
    // A simulated drive has the truth.
    let expected = ["motion.svg", "path.svg", "quality.svg", "topics.svg"];
    assert_eq!(names(&out), expected);
    assert!(picture(&out, "path.svg").contains("the truth alone"));
    for words in [
        "left out: latency.svg: the log has no poses of a live run",
        "left out: biases.svg: the log has no odometry/state with an IMU",
        "`randt run",
    ] {
        assert!(drawn.stderr_contains(words), "{words}: {}", drawn.stderr);
    }
}

#[test]
fn what_is_no_log_of_ours_or_empty_is_refused_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("pictures");
    let none = folder.path().join("none.mcap");
    fs::write(&none, "# stamp x y z\n").unwrap();
    let empty = folder.path().join("empty.mcap");
    let log = LogFile::create(&empty, Options::default()).unwrap();
    log.finish().unwrap();
    let absent = folder.path().join("absent.mcap");
    for (file, words) in [
        (&none, "not an MCAP file"),
        (&empty, "holds no message of ours"),
        (&absent, "absent.mcap: No such file"),
    ] {
        let drawn = plot(file, &out);
        assert_eq!(drawn.code, Some(1), "{}", drawn.stdout);
        assert!(drawn.stderr_contains(words), "{words}: {}", drawn.stderr);
    }
    assert!(!out.exists());
}

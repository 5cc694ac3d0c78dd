//! Whether a drive reports where it is wrong: worlds that only their ends, or nothing at all, fix
//! along the way.

use crate::support::{ended, figures, lab, randt, report, run, tum};
use randt_geometry::elementary::{sin, sin_cos};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Forty-four metres between bare walls, whose ends are out of sight in the middle.
const CORRIDOR: &str = "
wall concrete 0,-1.2 44,-1.2 44,1.2 0,1.2 0,-1.2
block wood 0,-1.2 0.6x0.8
route 2,-0.3 42,-0.3 42.4,0 42,0.3 2,0.3 1.6,0
";

/// A ring tunnel between walls of these radii, m; the robot drives between them.
fn ring(inner_m: f64, outer_m: f64) -> String {
    let circle = |radius_m: f64, corners: u32, last: u32| {
        let mut points = String::new();
        for corner in 0..=last {
            let (sin, cos) = sin_cos(f64::from(corner) * TAU / f64::from(corners));
            write!(points, " {:.3},{:.3}", radius_m * cos, radius_m * sin).unwrap();
        }
        points
    };
    format!(
        "wall concrete{}\nwall concrete{}\nroute{}\n",
        circle(inner_m, 48, 48),
        circle(outer_m, 48, 48),
        circle(0.5 * (inner_m + outer_m), 24, 23)
    )
}

/// Drives through a world; the figures of live odometry against the truth, those of the map, and
/// the report.
fn drive(folder: &Path, world: &str, scans: u32) -> [Value; 3] {
    let at = |name: &str| folder.join(name);
    fs::write(at("my.world"), world).unwrap();
    let mut command = randt(&["simulate", "--scans", &scans.to_string(), "--world"]);
    command.arg(at("my.world")).arg("--out").arg(at("my.mcap"));
    command.arg("--truth").arg(at("my.tum"));
    let simulated = ended(command);
    assert_eq!(simulated.code, Some(0), "{}", simulated.stderr);
    let out = at("out");
    let ran = run(&at("my.mcap"), &out, &["--profile", "mixed"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let mut command = lab(&["eval", "--json"]);
    command.arg(out.join("odometry.tum")).arg(at("my.tum"));
    command.arg("--trust").arg(out.join("report.json"));
    let evaluated = ended(command);
    assert_eq!(evaluated.code, Some(0), "{}", evaluated.stderr);
    let live: Value = serde_json::from_str(&evaluated.stdout).unwrap();
    let report = report(&out);
    assert_eq!(report["accuracy"]["silent_m"], live["silent_m"]);
    println!(
        "silent {} of {} m wrong, {:.1} % good, worst 10 s of good ones {:.2} m",
        live["silent_m"],
        live["wrong_m"],
        100.0 * live["good_share"].as_f64().unwrap(),
        live["worst_good_10s_m"].as_f64().unwrap()
    );
    [live, figures(&out, "trajectory.tum", &at("my.tum")), report]
}

#[test]
fn in_a_bare_corridor_trust_ends_before_the_estimate_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let [live, _, report] = drive(folder.path(), CORRIDOR, 230);
    // The world is as hard as it was made to be.
    assert!(live["wrong_m"].as_u64().unwrap() >= 5, "{live}");
    assert!(live["worst_good_10s_m"].as_f64().unwrap() < 0.3, "{live}");
    // Where an end is in sight the pose is good: all of the first fifteen seconds but the first
    // scan.
    let spans = report["trust_spans"].as_array().unwrap();
    assert_eq!(spans[0]["trust"], "degraded", "{spans:?}");
    assert_eq!(spans[1]["trust"], "good", "{spans:?}");
    assert_eq!(spans[0]["reasons"][0], "unsupported", "{spans:?}");
    let reasons = spans[2]["reasons"].as_array().unwrap();
    assert!(reasons.contains(&"weak".into()), "{spans:?}");
    assert!(report["trust_reasons"]["weak"]["path_m"].as_f64() > Some(1.0));
    let begins_s = |span: usize| spans[span]["begin_ns"].as_i64().unwrap() / 1_000_000_000;
    assert!(begins_s(2) - begins_s(0) >= 15, "{spans:?}");
    // The same, row by row, with the direction: that of the corridor.
    let out = folder.path().join("out");
    let table = fs::read_to_string(out.join("odometry.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    let [stamp, yaw, trust, weak] =
        ["stamp_ns", "yaw_rad", "trust", "weak_direction_rad"].map(column);
    let poses = tum(&out.join("odometry.tum"));
    assert_eq!(rows.len() - 1, poses.len());
    let (mut found, mut along) = (0, 0);
    for (row, pose) in rows[1..].iter().zip(poses) {
        assert_eq!(row[stamp], pose.stamp_ns.to_string());
        let Ok(direction_rad) = row[weak].parse::<f64>() else {
            assert!(["", "all"].contains(&row[weak]), "{row:?}");
            continue;
        };
        assert_eq!(row[trust], "degraded");
        found += 1;
        let yaw_rad: f64 = row[yaw].parse().unwrap();
        let is_along = sin(yaw_rad + direction_rad).abs() < sin(10_f64.to_radians());
        along += i32::from(is_along);
    }
    println!("{along} of {found} weak directions are along the corridor");
    assert!(found >= 20 && along * 10 >= found * 9, "{along} of {found}");
}

#[test]
fn in_a_ring_tunnel_no_metre_is_wrong_in_silence_and_fewer_loops_are_closed() {
    let folder = tempfile::tempdir().unwrap();
    let [live, map, _] = drive(folder.path(), &ring(6.0, 8.6), 480);
    assert_eq!(live["silent_m"], 0, "{live}");
    assert!(live["good_share"].as_f64().unwrap() < 0.05, "{live}");
    // Every one of them is false: nothing distinguishes one place from another. A registration
    // that takes the grid for information of the wall's closes 15.
    assert!(map["loops"]["loops"].as_u64().unwrap() <= 8, "{map}");
}

//! `randt calibrate extrinsics`.

use super::{
    Recording,
    path::{Mode, Path},
};
use crate::exit::Outcome;
use crate::output::{may_write, print_value, write_whole};
use randt_calibration::{LeverArm, Mounting, MountingYaw, Span, Unobservable, mounting};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `randt calibrate extrinsics`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    recording: Recording,
    /// Write the section [robot] for --robot: the radar's position as found here, the IMU's as it
    /// was
    #[arg(long, value_name = "ROBOT.toml")]
    write: Option<PathBuf>,
    /// Overwrite a file that exists
    #[arg(long)]
    force: bool,
}

/// Estimates and prints; fails where a figure was not shown.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let recording = &arguments.recording;
    if let Some(file) = &arguments.write {
        may_write(file, arguments.force)?;
    }
    let log = recording.log.display().to_string();
    let path = Path::read(recording, Mode::RadarOnly)?;
    let found = mounting(&path.poses);
    let json = as_json(&log, &path, &found);
    print_value(recording.json, &json, || as_text(&path, &found))?;
    let (Ok(heading), Ok(lever_arm)) = (&found.yaw, &found.lever_arm) else {
        for (name, why) in [
            ("yaw", found.yaw.as_ref().err()),
            ("lever arm", found.lever_arm.as_ref().err()),
        ] {
            if let Some(why) = why {
                eprintln!("error: {log}: no {name}: {why}");
            }
        }
        return Ok(Outcome::Failed);
    };
    if let Some(file) = &arguments.write {
        write_whole(file, robot_toml(&path, heading, lever_arm).as_bytes())?;
    }
    Ok(Outcome::finished(path.lost))
}

fn as_json(log: &str, path: &Path, found: &Mounting) -> Value {
    let seconds =
        |spans: &[Span]| -> Vec<_> { spans.iter().map(|span| path.seconds(span)).collect() };
    let refused = |why: &Unobservable| json!({ "refused": why.to_string() });
    let yaw = found.yaw.as_ref().map_or_else(refused, |heading| {
        let yaw_deg = heading.yaw_rad.scaled(1f64.to_degrees());
        json!({
            "yaw_deg": yaw_deg.value,
            "sigma_deg": yaw_deg.sigma,
            "shown_by": { "spans_s": seconds(&heading.spans), "driven_m": heading.path_m },
        })
    });
    let lever_arm = found.lever_arm.as_ref().map_or_else(refused, |lever_arm| -> Value {
        let [left, right] = lever_arm.pivot.turned_rad.map(f64::to_degrees);
        json!({
            "x_m": lever_arm.x_m.value,
            "x_sigma_m": lever_arm.x_m.sigma,
            "y_m": lever_arm.y_m.value,
            "y_sigma_m": lever_arm.y_m.sigma,
            "shown_by": { "spans_s": seconds(&lever_arm.pivot.spans), "left_deg": left, "right_deg": right },
        })
    });
    json!({ "input": log, "yaw": yaw, "lever_arm": lever_arm })
}

fn as_text(path: &Path, found: &Mounting) -> String {
    let yaw = match &found.yaw {
        Ok(heading) => {
            let yaw_deg = heading.yaw_rad.scaled(1f64.to_degrees());
            format!(
                "yaw          {:+.3} ± {:.3} deg\n  shown by   {}: {:.1} m straight\n",
                yaw_deg.value,
                yaw_deg.sigma,
                super::spans(path, &heading.spans),
                heading.path_m,
            )
        }
        Err(why) => format!("yaw          refused: {why}\n"),
    };
    let lever_arm = match &found.lever_arm {
        Ok(lever_arm) => {
            let [left, right] = lever_arm.pivot.turned_rad.map(f64::to_degrees);
            format!(
                "x            {:+.4} ± {:.4} m\ny            {:+.4} ± {:.4} m\n  \
                 shown by   {}: {left:.0} deg in place to the left, {right:.0} to the right\n",
                lever_arm.x_m.value,
                lever_arm.x_m.sigma,
                lever_arm.y_m.value,
                lever_arm.y_m.sigma,
                super::spans(path, &lever_arm.pivot.spans),
            )
        }
        Err(why) => format!("x, y         refused: {why}\n"),
    };
    format!("radar in base_link\n{yaw}{lever_arm}")
}

fn robot_toml(path: &Path, heading: &MountingYaw, lever_arm: &LeverArm) -> String {
    let robot = &path.robot;
    format!(
        "# Where the sensors sit on the robot. The radar's position: randt calibrate extrinsics.\n\
         [robot]\n\
         radar_x_m = {:.4} # sigma {:.4}\n\
         radar_y_m = {:.4} # sigma {:.4}\n\
         radar_yaw_rad = {:.5} # sigma {:.5}\n\
         imu_roll_rad = {:?}\n\
         imu_pitch_rad = {:?}\n\
         imu_yaw_rad = {:?}\n",
        lever_arm.x_m.value,
        lever_arm.x_m.sigma,
        lever_arm.y_m.value,
        lever_arm.y_m.sigma,
        heading.yaw_rad.value,
        heading.yaw_rad.sigma,
        robot.imu_roll_rad,
        robot.imu_pitch_rad,
        robot.imu_yaw_rad,
    )
}

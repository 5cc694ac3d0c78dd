//! `randt calibrate time`.

use super::{
    Recording,
    path::{Mode, Path},
};
use crate::exit::Outcome;
use crate::output::print_value;
use anyhow::{Context, ensure};
use randt_calibration::{Gyro, TimeOffset, time_offset};
use serde_json::{Value, json};

/// Rounds of de-skew and estimate.
const ROUNDS: u32 = 5;
/// A change of the offset that ends them, s: a hundredth of what a sweep's stamps are good for.
const SETTLED_S: f64 = 1e-4;

/// Estimates and prints.
///
/// Odometry without the gyro cannot be misled by its stamps, but lags where a turn begins. So its
/// offset is a first guess, with which the gyro takes the turn out of the sweeps; what odometry
/// finds then gives the next.
pub fn run(recording: &Recording) -> anyhow::Result<Outcome> {
    let log = recording.log.display();
    let mut path = Path::read(recording, Mode::WithoutGyro)?;
    ensure!(
        !path.rates.is_empty(),
        "{log}: no IMU sample in it, so there is no gyro to compare the radar with"
    );
    let gyro = Gyro::new(&path.rates);
    if gyro.rejected > 0 {
        eprintln!(
            "warning: {} IMU samples of no use: no numbers, or stamps that do not go on",
            gyro.rejected
        );
    }
    let estimate = |path: &Path| {
        time_offset(&path.poses, &gyro).with_context(|| format!("{log}: no time offset"))
    };
    let mut found = estimate(&path)?;
    for _ in 0..ROUNDS {
        let before_s = found.late_s.value;
        path = Path::read(recording, Mode::DeskewedByGyro((before_s * 1e9) as i64))?;
        found = estimate(&path)?;
        if (found.late_s.value - before_s).abs() < SETTLED_S {
            break;
        }
    }
    let json = as_json(&log.to_string(), &path, &found);
    print_value(recording.json, &json, || as_text(&path, &found))?;
    Ok(Outcome::finished(path.lost || gyro.rejected > 0))
}

fn as_json(log: &str, path: &Path, found: &TimeOffset) -> Value {
    let spans: Vec<_> = found.spans.iter().map(|span| path.seconds(span)).collect();
    let late_ms = found.late_s.scaled(1e3);
    json!({
        "input": log,
        "radar_late_ms": late_ms.value,
        "radar_late_sigma_ms": late_ms.sigma,
        "shown_by": { "spans_s": spans, "turned_deg": found.turned_rad.to_degrees() },
        "gyro_scale": found.scale,
        "residual_deg": found.residual_rad.to_degrees(),
    })
}

fn as_text(path: &Path, found: &TimeOffset) -> String {
    let late_ms = found.late_s.scaled(1e3);
    let size = late_ms.value.abs();
    let word = if late_ms.value < 0.0 { "early" } else { "late" };
    format!(
        "radar stamps are {size:.2} ± {sigma:.2} ms {word} against the gyro: set odometry.radar_late_s = {value:.5}\n\
         shown by     {spans}: {turned:.0} deg turned\n\
         left over    {left:.3} deg from scan to scan; the radar turns {scale:+.2} % more than the gyro\n",
        scale = 100.0 * found.scale,
        sigma = late_ms.sigma,
        value = found.late_s.value,
        spans = super::spans(path, &found.spans),
        turned = found.turned_rad.to_degrees(),
        left = found.residual_rad.to_degrees(),
    )
}

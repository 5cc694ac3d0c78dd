//! `randt-lab imu`: examines an IMU recording.
//!
//! Responsible for what is printed. What the recording shows is found by `examination`, with the
//! filters that run on the robot.

mod columns;
mod examination;
mod sample;
mod table;

use anyhow::bail;
use examination::Examination;
use nalgebra::Vector3;
use randt::exit::Outcome;
use randt::output::{print_value, write_whole};
use randt_config::SelectionArguments;
use randt_filter::Mounting;
use sample::Samples;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `randt-lab imu`.
///
/// The recording is read once, sample by sample, as a robot would: a bias is used from the moment
/// a standstill has shown it; only the time before the first one is computed afterwards, with the
/// bias that it showed. Biases and axes are those of the IMU itself.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A ROS bag, one of our logs, or CSV with a header (stamp, rate and acceleration about x, y,
    /// z; units in the names, SI where there are none; commas, semicolons or tabs)
    file: PathBuf,
    /// IMU topic of a bag; if not given, the one with the most messages
    #[arg(long, value_name = "NAME")]
    imu_topic: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write the attitude of every sample as TUM rows (position zero)
    #[arg(long, value_name = "FILE.tum")]
    attitude: Option<PathBuf>,
    #[command(flatten)]
    selection: SelectionArguments,
}

/// Examines and prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let config = arguments.selection.load(None)?.config;
    let mut samples = Samples::open(&arguments.file, arguments.imu_topic)?;
    let mut examination = Examination::new(&config, arguments.attitude.is_some());
    while let Some(sample) = samples.next_sample()? {
        examination.push(sample);
    }
    examination.finish();
    let file = arguments.file.display().to_string();
    let counters = samples.counters();
    if examination.timing().samples == 0 {
        let why = counters
            .first()
            .map_or(String::new(), |c| format!("; {}: {}", c.name, c.first));
        bail!("{file}: no IMU sample in it{why}");
    }
    if let (Some(path), Some(rows)) = (&arguments.attitude, examination.trajectory()) {
        write_whole(path, rows.as_bytes())?;
    }
    let lost = counters.iter().any(|counter| counter.loss)
        || examination.attitude().clock().not_finite() > 0;
    for counter in &counters {
        eprintln!(
            "warning: {} {}: {}",
            counter.count, counter.name, counter.first
        );
    }
    let format = samples.format();
    let json = as_json(&file, format, &examination, &counters);
    print_value(arguments.json, &json, || {
        as_text(&file, format, &examination)
    })?;
    Ok(Outcome::finished(lost))
}

fn as_json(
    file: &str,
    format: &str,
    examination: &Examination,
    counters: &[randt_readers::Counter],
) -> Value {
    let axes = |v: Vector3<f64>| [v.x, v.y, v.z];
    let degrees = |v: Vector3<f64>| axes(v.map(f64::to_degrees));
    let bias = examination.bias_rad_s();
    let mounting = examination.mounting();
    let (roll, pitch, _) = examination.attitude().attitude().roll_pitch_yaw();
    let clock = examination.attitude().clock();
    let counted: Vec<_> = counters
        .iter()
        .map(|c| json!({ "name": c.name, "count": c.count, "first": c.first, "loss": c.loss }))
        .collect();
    json!({
        "input": file,
        "format": format,
        "sampling": examination.timing(),
        "ignored_not_after": clock.not_after(),
        "ignored_not_finite": clock.not_finite(),
        "clock_breaks": clock.breaks(),
        "counters": counted,
        "standstills": examination.standstills(),
        "bias_rad_s": bias.map(|(mean, _)| axes(mean)),
        "bias_sigma_rad_s": bias.map(|(_, sigma)| axes(sigma)),
        "bias_deg_s": bias.map(|(mean, _)| degrees(mean)),
        "bias_sigma_deg_s": bias.map(|(_, sigma)| degrees(sigma)),
        "mounting": mounting.map(|v| json!({ "up_axis": v.up_axis(), "up": axes(v.up) })),
        "upside_down": mounting.map(|v| v.mounting == Mounting::UpsideDown),
        "upside_down_known_after_s": mounting.map(|v| v.known_after_s),
        "heading_deg": examination.heading_rad().to_degrees(),
        "turned_deg": examination.turned_rad().to_degrees(),
        "roll_deg": roll.to_degrees(),
        "pitch_deg": pitch.to_degrees(),
    })
}

fn as_text(file: &str, format: &str, examination: &Examination) -> String {
    let timing = examination.timing();
    let mut text = format!(
        "{file} ({format})\n\
         samples      {} in {:.3} s, {:.1} Hz; intervals {:.2} to {:.2} ms, {} gaps\n",
        timing.samples,
        timing.duration_s,
        timing.sample_rate_hz,
        timing.interval_min_ms,
        timing.interval_max_ms,
        timing.gaps,
    );
    let mut line = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<12} {value}");
    };
    let clock = examination.attitude().clock();
    let ignored = clock.not_after() + clock.not_finite();
    if ignored + clock.breaks() > 0 {
        line(
            "stamps",
            format!(
                "{} repeated or back, {} samples not finite, {} breaks",
                clock.not_after(),
                clock.not_finite(),
                clock.breaks()
            ),
        );
    }
    line(
        "mounting",
        examination
            .mounting()
            .map_or("unknown: gravity does not show".to_owned(), |v| {
                let words = match v.mounting {
                    Mounting::Upright => "upright",
                    Mounting::UpsideDown => "upside down",
                    Mounting::OnItsSide => "on its side",
                };
                format!(
                    "{words} ({} is up), known after {:.2} s",
                    v.up_axis(),
                    v.known_after_s
                )
            }),
    );
    for span in examination.standstills() {
        line(
            "standstill",
            format!("{:.2} s to {:.2} s", span.begin_s, span.end_s),
        );
    }
    line(
        "gyro bias",
        examination.bias_rad_s().map_or(
            "unknown: it never stood still".to_owned(),
            |(mean, sigma)| {
                let axis = |i: usize| {
                    format!(
                        "{:+.4} ± {:.4}",
                        mean[i].to_degrees(),
                        sigma[i].to_degrees()
                    )
                };
                format!(
                    "{}, {}, {} deg/s (IMU's x, y, z)",
                    axis(0),
                    axis(1),
                    axis(2)
                )
            },
        ),
    );
    let turned = examination.turned_rad().to_degrees();
    line(
        "heading",
        format!(
            "{:+.2} deg about the vertical, {turned:.0} deg turned in all",
            examination.heading_rad().to_degrees()
        ),
    );
    text
}

//! Whether the IMU's samples make sense.

use super::capture::Seen;
use super::rates;
use crate::commands::doctor::finding::Finding;
use nalgebra::Vector3;
use randt_config::{Config, ImuSource};
use randt_filter::{Mounting, MountingCheck};
use randt_geometry::Quaternion;
use randt_messages::ImuSample;

const ABOUT: &str = "imu";
/// The rate may be off by this share of what is asked for.
const RATE_TOLERANCE: f64 = 0.05;
/// This many periods without a sample are a gap.
const GAP: i64 = 3;

/// What it shows by itself.
pub fn check(config: &Config, seen: &Seen<ImuSample>) -> Vec<Finding> {
    let mut found = vec![reached(config, seen)];
    if seen.came.len() < 2 {
        return found;
    }
    found.push(rate(config, seen));
    found.push(stamps(config, seen));
    found.push(gravity(config, seen));
    found.extend(rates::check(seen));
    found
}

fn reached(config: &Config, seen: &Seen<ImuSample>) -> Finding {
    let imu = &config.imu;
    let place = match imu.source {
        ImuSource::Phidget22 if !imu.server.is_empty() => format!("the server {}", imu.server),
        ImuSource::Phidget22 => "USB".to_owned(),
        _ => imu.device.clone(),
    };
    let fix = match imu.source {
        ImuSource::Phidget22 => {
            "is it plugged in? lsusb -d 06c2: shows it; rights: a udev rule for 06c2"
        }
        ImuSource::Line => {
            "does its device send to imu.device, lines as docs/lines.md has them? A firewall may drop datagrams; rights of a port: group dialout"
        }
        ImuSource::Mip | ImuSource::Xsens => {
            "ls -l /dev/serial/by-id/ shows what is plugged in; imu.device names it; rights: group dialout"
        }
    };
    seen.reached(ABOUT, &format!("samples come from {place}"), fix)
}

fn rate(config: &Config, seen: &Seen<ImuSample>) -> Finding {
    let (Some((_, first)), Some((_, last))) = (seen.came.first(), seen.came.last()) else {
        return Finding::ok(ABOUT, "no sample");
    };
    let span_s = (last.header.stamp_ns - first.header.stamp_ns) as f64 * 1e-9;
    let rate_hz = (seen.came.len() - 1) as f64 / span_s;
    let text = format!("{rate_hz:.1} samples a second");
    let asked_hz = config.imu.rate_hz;
    if (rate_hz / asked_hz - 1.0).abs() < RATE_TOLERANCE {
        Finding::ok(ABOUT, text)
    } else {
        Finding::warn(
            ABOUT,
            format!("{text} instead of {asked_hz}"),
            "is the port fast enough (imu.baud), and the rate one that the device can (imu.rate_hz)?",
        )
    }
}

fn stamps(config: &Config, seen: &Seen<ImuSample>) -> Finding {
    let period_ns = (1e9 / config.imu.rate_hz) as i64;
    let stamps = seen.came.iter().map(|(_, sample)| sample.header.stamp_ns);
    let steps = stamps.clone().zip(stamps.skip(1)).map(|(a, b)| b - a);
    let gaps = steps.clone().filter(|step| *step > GAP * period_ns).count();
    let longest_ms = steps.clone().max().unwrap_or(0) as f64 * 1e-6;
    let samples = seen.came.iter().map(|(_, sample)| sample);
    let delays = samples.map(|it| it.arrival_ns - it.header.stamp_ns);
    let mut delays: Vec<i64> = delays.collect();
    delays.sort_unstable();
    let delay_ms = delays.get(delays.len() / 2).copied().unwrap_or(0) as f64 * 1e-6;
    let text = format!(
        "stamps rise, longest step {longest_ms:.1} ms, arrival {delay_ms:.1} ms later in the middle"
    );
    let is_set = |count: &&randt_device::Count| count.name == "clock_resets" && count.value > 0;
    if let Some(resets) = seen.counts.iter().find(is_set) {
        let text = format!("the device's clock was set {} times; {text}", resets.value);
        let fix = "does it begin anew, by its supply? A clock that is set to another one's time must not step";
        return Finding::bad(ABOUT, text, fix);
    }
    match gaps {
        _ if steps.clone().any(|step| step <= 0) => Finding::bad(
            ABOUT,
            "stamps do not rise",
            "report it to the makers of randt",
        ),
        0 => Finding::ok(ABOUT, text),
        gaps => Finding::warn(
            ABOUT,
            format!("{gaps} gaps; {text}"),
            "another cable or port; a USB hub of its own; FTDI: latency_timer 1",
        ),
    }
}

/// Length and direction, as the robot has it.
fn gravity(config: &Config, seen: &Seen<ImuSample>) -> Finding {
    const ABOUT: &str = "gravity";
    let robot = &config.robot;
    let base_from_imu =
        Quaternion::from_roll_pitch_yaw(robot.imu_roll_rad, robot.imu_pitch_rad, robot.imu_yaw_rad);
    let mut check = MountingCheck::default();
    let mut mean_m_s2 = Vector3::zeros();
    let mut found = None;
    for (_, sample) in &seen.came {
        let force_m_s2 = base_from_imu.rotate(Vector3::from(sample.acceleration_m_s2));
        mean_m_s2 += force_m_s2 / seen.came.len() as f64;
        found = found.or_else(|| check.push(sample.header.stamp_ns, force_m_s2));
    }
    let length_m_s2 = mean_m_s2.norm();
    let Some(found) = found else {
        let text = format!("there is none: the mean acceleration is {length_m_s2:.2} m/s^2");
        let fix = "the IMU must send specific force in m/s^2, gravity included: neither in g nor \"linear acceleration\"";
        return Finding::bad(ABOUT, text, fix);
    };
    let text = format!(
        "up is {} of the robot, {length_m_s2:.2} m/s^2",
        found.up_axis()
    );
    let fix = "stand the robot level; then set imu.acceleration_axes (sign) or robot.imu_roll_rad (mounting)";
    match found.mounting {
        Mounting::Upright => Finding::ok(ABOUT, text),
        _ => Finding::bad(ABOUT, text, fix),
    }
}

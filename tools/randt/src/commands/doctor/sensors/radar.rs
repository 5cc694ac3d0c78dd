//! Whether the radar's sweeps make sense.

use super::capture::{Seen, Sweep};
use super::turning::{Panorama, Sense, sense};
use crate::commands::doctor::finding::Finding;
use randt_config::{Config, RadarSource};
use randt_filter::check_sweep;
use randt_messages::{ImuSample, SweepHead};

const ABOUT: &str = "radar";
/// The rate may be off by this share of the sensor file's.
const RATE_TOLERANCE: f64 = 0.1;
/// A sweep is published within this time after its end, ns: the last beams' way, and a moment of a
/// busy machine.
const DELAY_MAX_NS: i64 = 200_000_000;
/// A sweep ends half a beam after its last beam was measured, which may be on its way then: 0.5 ms
/// of an iSDR-C's.
const EARLY_MAX_NS: i64 = 2_000_000;

/// What it shows by itself.
pub fn check(config: &Config, seen: &Seen<Sweep>) -> Vec<Finding> {
    let mut found = vec![reached(config, seen)];
    if seen.came.len() < 2 {
        let fix = "wait, or see what the radar is set to; `randt doctor sensors --seconds 20` looks longer";
        if seen.link.streams() {
            found.push(Finding::bad(ABOUT, "no whole sweep came", fix));
        }
        return found;
    }
    found.push(rate(config, seen));
    found.push(beams(config, seen));
    found.push(stamps(seen));
    found.push(losses(seen));
    found
}

fn reached(config: &Config, seen: &Seen<Sweep>) -> Finding {
    let address = &config.radar.address;
    seen.reached(ABOUT, &format!("beams come from {address}"), &fix(config))
}

fn fix(config: &Config) -> String {
    let address = &config.radar.address;
    match config.radar.source {
        RadarSource::Navtech => format!(
            "is the radar on, its cable in, and {address} (radar.address) its own? ping it; ip address shows whether this host is in its network"
        ),
        RadarSource::BeamUdp => format!(
            "does the bridge send to {address} (radar.address)? tcpdump -n udp shows what arrives; a firewall may drop it"
        ),
    }
}

fn rate(config: &Config, seen: &Seen<Sweep>) -> Finding {
    let (_, period_ns) = periods(seen);
    let period_s = period_ns as f64 * 1e-9;
    let expected_s = config.sensor.period_s;
    let text = format!("{:.2} sweeps a second", 1.0 / period_s);
    if (period_s / expected_s - 1.0).abs() < RATE_TOLERANCE {
        Finding::ok(ABOUT, text)
    } else {
        let expected = format!("{text}; the sensor file says {:.2}", 1.0 / expected_s);
        let fix = format!("set sensor.period_s = {period_s:.3}, or the radar's speed");
        Finding::warn(ABOUT, expected, fix)
    }
}

fn beams(config: &Config, seen: &Seen<Sweep>) -> Finding {
    let Some((_, last)) = seen.came.last() else {
        return Finding::ok(ABOUT, "no sweep");
    };
    let head = &last.head;
    let text = format!(
        "{} beams, {} returns a sweep, bins of {:.4} m",
        head.beam_count, last.returns, head.range_resolution_m
    );
    match check_sweep(head, config) {
        Err(error) => {
            let fix = "give the radar's own sensor file to --sensor";
            Finding::bad(ABOUT, format!("{text}: {error}"), fix)
        }
        Ok(()) if last.returns == 0 => {
            let power = config.sensor.keep_power;
            let fix = format!("does it transmit? sensor.keep_power is {power}");
            Finding::bad(ABOUT, format!("{text}: nothing is above its floor"), fix)
        }
        Ok(()) => Finding::ok(ABOUT, text),
    }
}

fn stamps(seen: &Seen<Sweep>) -> Finding {
    let came = seen.came.iter();
    let delays = came.map(|(at_ns, sweep)| at_ns - sweep.head.end_ns);
    let (least, most) = (delays.clone().min().unwrap_or(0), delays.max().unwrap_or(0));
    let rising = periods(seen).0.iter().all(|period_ns| *period_ns > 0);
    let text = format!(
        "sweeps are there {:.1} to {:.1} ms after their end",
        least as f64 * 1e-6,
        most as f64 * 1e-6
    );
    let fix = "randt top shows the driver's message; a radar with a clock of its own should get its time by PTP or NTP";
    if !rising {
        Finding::bad(ABOUT, "stamps do not rise", fix)
    } else if least < -EARLY_MAX_NS || most > DELAY_MAX_NS {
        Finding::warn(ABOUT, text, fix)
    } else {
        Finding::ok(ABOUT, text)
    }
}

/// The times from the end of a sweep to that of the next, and the usual one of them, ns.
fn periods(seen: &Seen<Sweep>) -> (Vec<i64>, i64) {
    let ends = seen.came.iter().map(|(_, sweep)| sweep.head.end_ns);
    let mut periods: Vec<i64> = ends.clone().zip(ends.skip(1)).map(|(a, b)| b - a).collect();
    periods.sort_unstable();
    let usual = periods.get(periods.len() / 2).copied();
    (periods, usual.unwrap_or_default())
}

/// Sweeps that are not there, by the pauses between those that are.
fn sweeps_missing(seen: &Seen<Sweep>) -> u64 {
    let (periods, usual_ns) = periods(seen);
    let usual_ns = usual_ns.max(1);
    let missing = periods.iter().map(|it| (it + usual_ns / 2) / usual_ns - 1);
    missing.map(|missing| missing.max(0).unsigned_abs()).sum()
}

fn losses(seen: &Seen<Sweep>) -> Finding {
    let sum = |count: fn(&SweepHead) -> u32| -> u64 {
        let counts = seen.came.iter().map(|(_, sweep)| count(&sweep.head));
        counts.map(u64::from).sum()
    };
    let (lost, beams) = (sum(|head| head.beams_lost), sum(|head| head.beam_count));
    let missing = sweeps_missing(seen);
    match lost {
        _ if missing > 0 => Finding::warn(
            ABOUT,
            format!(
                "{missing} whole sweeps are missing between those that came, and {lost} beams in these"
            ),
            "does the radar's link hold? randt top and the driver's journal show when it was interrupted",
        ),
        0 => Finding::ok(ABOUT, format!("no beam of {beams} is missing")),
        lost => Finding::warn(
            ABOUT,
            format!("{lost} beams of {} are missing", beams + lost),
            "a wired link of its own; raise radar.receive_buffer_bytes and net.core.rmem_max",
        ),
    }
}

/// Whether it turns as the gyro does.
pub fn check_sense(radar: &Seen<Sweep>, imu: &Seen<ImuSample>) -> Finding {
    const ABOUT: &str = "rotation";
    let mut heading = vec![(i64::MIN, 0.0)];
    let mut last: Option<&ImuSample> = None;
    for (_, sample) in &imu.came {
        let stamp_ns = sample.header.stamp_ns;
        let step_s = last.map_or(0.0, |last| (stamp_ns - last.header.stamp_ns) as f64 * 1e-9);
        let (_, turned) = heading.last().copied().unwrap_or_default();
        heading.push((stamp_ns, turned + sample.rate_rad_s[2] * step_s));
        last = Some(sample);
    }
    let sweeps = radar.came.iter().map(|(_, sweep)| sweep.panorama.clone());
    let sweeps: Vec<Panorama> = sweeps.collect();
    let at = |stamp_ns: i64| {
        let after = heading.partition_point(|(at_ns, _)| *at_ns <= stamp_ns);
        let last = heading.get(after.saturating_sub(1));
        last.map_or(0.0, |(_, turned)| *turned)
    };
    match sense(&sweeps, at) {
        Sense::Agrees(_) => Finding::ok(ABOUT, "radar and gyro turn the same way"),
        Sense::TooLittle(turned) => Finding::warn(
            ABOUT,
            format!(
                "not known: the robot turned by {:.0} degrees only",
                turned.to_degrees()
            ),
            "turn the robot by hand or drive a curve while this runs, with --seconds 20",
        ),
        Sense::Opposed(_) => Finding::bad(
            ABOUT,
            "radar and gyro turn against each other",
            "one of them is mirrored or upside down: see imu.rate_axes, robot.imu_roll_rad and the bridge's azimuths",
        ),
        Sense::Unclear(_) => Finding::warn(
            ABOUT,
            "not known: the radar does not turn as the gyro does, nor against it",
            "look in a room with walls nearby, and turn slowly; is the gyro's unit right?",
        ),
    }
}

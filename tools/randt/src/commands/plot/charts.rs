//! The figures over time: which panels each picture has.

use super::recording::Recording;
use crate::latency::Latency;
use randt_evaluation::{Band, Colour, Line, Panel};
use randt_geometry::Quaternion;
use randt_messages::{
    ImuSampleTopic, ImuUse, OdometryState, OdometryStateTopic, RadarPoints, RadarScan, Trust,
};

/// The panels of a picture, or what the log lacks for it.
pub type Panels = Result<Vec<Panel>, &'static str>;

/// Speed, and yaw rate beside the gyro's.
pub fn motion(recording: &Recording) -> Panels {
    if !recording.has::<OdometryStateTopic>() && !recording.has::<ImuSampleTopic>() {
        return Err("odometry/state and no imu/sample");
    }
    let mut panels = Vec::new();
    if recording.has::<OdometryStateTopic>() {
        let speed = |axis: usize| of_states(recording, move |s| s.velocity.get(axis).copied());
        panels.push(panel(
            "speed, m/s",
            vec![
                line("to the left", Colour::Second, speed(1)),
                line("forward", Colour::First, speed(0)),
            ],
        ));
    }
    let gyro = recording.gyro.iter();
    let gyro = gyro.map(|(at_ns, rate_rad_s)| [recording.after_s(*at_ns), rate_rad_s.to_degrees()]);
    let turning = of_states(recording, |s| Some(s.velocity[2].to_degrees()));
    panels.push(panel(
        "yaw rate, deg/s",
        vec![
            line("gyro", Colour::Faint, gyro.collect()),
            line("odometry", Colour::First, turning),
        ],
    ));
    Ok(panels)
}

/// How well scans fit the submap and fix the pose, and how much there was to see.
pub fn quality(recording: &Recording) -> Panels {
    let has_states = recording.has::<OdometryStateTopic>();
    if !(has_states || recording.has::<RadarScan>() || recording.has::<RadarPoints>()) {
        return Err("odometry/state and no radar");
    }
    let mut panels = Vec::new();
    if has_states {
        let share = |s: &OdometryState| 100.0 * f64::from(s.inliers) / f64::from(s.cells.max(1));
        let mut fit = panel(
            "cells of the scan that have a counterpart in the submap, %",
            vec![line(
                "",
                Colour::First,
                of_states(recording, |s| Some(share(s))),
            )],
        );
        fit.at_least = Some([0.0, 100.0]);
        fit.bands = trust(recording);
        // What the scan alone fixes: the information's inverse is a variance.
        let deviation_mm = |axis: usize| {
            of_states(recording, move |s| {
                let information = s.information_eigenvalues.get(axis).copied();
                information.filter(|i| *i > 0.0).map(|i| 1e3 / i.sqrt())
            })
        };
        let mut degeneracy = panel(
            "position as the scan alone fixes it, standard deviation, mm",
            vec![
                line("best direction", Colour::Second, deviation_mm(1)),
                line("worst direction", Colour::First, deviation_mm(0)),
            ],
        );
        degeneracy.cut_outliers = true;
        panels.extend([from_zero(fit), from_zero(degeneracy)]);
    }
    let counts = |counts: &[(i64, usize)]| -> Vec<[f64; 2]> {
        let counts = counts.iter();
        counts
            .map(|(at_ns, count)| [recording.after_s(*at_ns), *count as f64])
            .collect()
    };
    let named = [
        ("all", Colour::Second, counts(&recording.scans)),
        ("after the filter", Colour::First, counts(&recording.points)),
    ];
    let there = named.into_iter().filter(|(.., points)| !points.is_empty());
    let lines: Vec<Line> = there
        .map(|(name, colour, points)| line(name, colour, points))
        .collect();
    if !lines.is_empty() {
        panels.push(from_zero(panel("returns of a sweep", lines)));
    }
    if has_states {
        let cells = of_states(recording, |s| Some(f64::from(s.cells)));
        let lines = vec![line("", Colour::First, cells)];
        panels.push(from_zero(panel("NDT cells of a sweep", lines)));
    }
    Ok(panels)
}

/// When the pose was less than good.
fn trust(recording: &Recording) -> Vec<Band> {
    let states = recording.states.iter().zip(recording.states.iter().skip(1));
    let marked = states.filter_map(|((begin_ns, state), (end_ns, _))| {
        let trust = state.trust();
        let colour = match trust {
            Trust::Good => return None,
            Trust::Degraded => Colour::Warning,
            Trust::Lost => Colour::Bad,
        };
        let span_s = [*begin_ns, *end_ns].map(|at_ns| recording.after_s(at_ns));
        Some(Band {
            name: trust.as_str(),
            colour,
            span_s,
        })
    });
    marked.collect()
}

/// From the end of a sweep to its pose, in the two parts of `randt top`.
pub fn latency(recording: &Recording) -> Panels {
    let part = |part: fn(&Latency) -> f64| {
        of_states(recording, move |state| {
            // A file that was computed, not run, has no time of publishing.
            let is_live = state.header.published_ns != 0;
            let latency = Latency::from_state(state).filter(|_| is_live);
            latency.map(|latency| part(&latency))
        })
    };
    let (wait, compute) = (part(|l| l.wait_ms), part(|l| l.compute_ms));
    if compute.iter().all(|point| point[1].is_nan()) {
        return Err("poses of a live run with an IMU");
    }
    let panel = |label, points| Panel {
        cut_outliers: true,
        ..from_zero(panel(label, vec![line("", Colour::First, points)]))
    };
    Ok(vec![
        panel(
            "wait: from the sweep's end until the IMU covered it, ms",
            wait,
        ),
        panel(
            "compute: from scan and IMU on the bus until the pose was there, ms",
            compute,
        ),
    ])
}

/// Biases of the gyro as odometry learned them, and how the robot was inclined.
pub fn biases(recording: &Recording) -> Panels {
    let states = recording.states.iter();
    let uses_imu = |s: &OdometryState| s.imu_use != ImuUse::None as u32;
    if !states.clone().any(|(_, state)| uses_imu(state)) {
        return Err("odometry/state with an IMU");
    }
    let bias = |axis: usize| {
        of_states(recording, move |s| {
            // All zero is before it has learned any.
            let is_known = uses_imu(s) && s.gyro_bias_rad_s != [0.0; 3];
            let bias_rad_s = s.gyro_bias_rad_s.get(axis).filter(|_| is_known);
            bias_rad_s.map(|bias_rad_s| bias_rad_s.to_degrees())
        })
    };
    let inclined = |part: fn((f64, f64, f64)) -> f64| {
        of_states(recording, move |s| {
            let [w, x, y, z] = s.attitude;
            let angles = Quaternion::new(w, x, y, z).roll_pitch_yaw();
            Some(part(angles).to_degrees()).filter(|_| uses_imu(s))
        })
    };
    Ok(vec![
        panel(
            "bias of the gyro about its own axes, deg/s",
            vec![
                line("x", Colour::Third, bias(0)),
                line("y", Colour::Second, bias(1)),
                line("z", Colour::First, bias(2)),
            ],
        ),
        panel(
            "inclination, deg",
            vec![
                line("roll", Colour::Second, inclined(|(roll, ..)| roll)),
                line("pitch", Colour::First, inclined(|(_, pitch, _)| pitch)),
            ],
        ),
    ])
}

/// A figure of every state; where it has none the line is broken.
fn of_states(
    recording: &Recording,
    figure: impl Fn(&OdometryState) -> Option<f64>,
) -> Vec<[f64; 2]> {
    let point = |(at_ns, state): &(i64, OdometryState)| {
        let value = figure(state).unwrap_or(f64::NAN);
        [recording.after_s(*at_ns), value]
    };
    recording.states.iter().map(point).collect()
}

pub fn line(name: &'static str, colour: Colour, points: Vec<[f64; 2]>) -> Line {
    Line {
        name,
        colour,
        points,
    }
}

fn panel(label: &str, lines: Vec<Line>) -> Panel {
    Panel {
        label: label.to_owned(),
        lines,
        ..Panel::default()
    }
}

fn from_zero(panel: Panel) -> Panel {
    Panel {
        at_least: Some(panel.at_least.unwrap_or([0.0, 0.0])),
        ..panel
    }
}

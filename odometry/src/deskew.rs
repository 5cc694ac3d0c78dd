//! Removes the motion inside a sweep, beam by beam.
//!
//! A return measured at t < T, T the sweep's end, is moved into the robot's frame at T: rotation from the
//! integrated gyro, translation from the velocity, which runs straight from the last scan's to this one's.

use crate::{heading::Heading, tilt::Tilt};
use nalgebra::{Vector2, Vector3};
use randt_config::Robot;
use randt_geometry::{Pose2, elementary::sin_cos};
use randt_messages::{Message, RadarPoints};

/// A return in the robot's level frame at the sweep's end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Forward, m.
    pub x_m: f64,
    /// Left, m.
    pub y_m: f64,
    /// In the sensor's unit.
    pub intensity: f64,
    /// d position / d velocity at the sweep's end, s.
    pub lever_s: f64,
    /// Index of its beam.
    pub beam: u16,
}

/// Where the radar was, and where the beam looked, in the robot's level frame at the sweep's end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamPose {
    /// Origin, m.
    pub origin: Vector2<f64>,
    /// Unit vector of the beam; shorter where it is tilted out of the level plane.
    pub direction: Vector2<f64>,
    /// d position / d velocity, s.
    pub lever_s: f64,
}

/// How the robot moved during a sweep, as far as is known.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Velocity at the sweep's end.
    pub velocity: Vector3<f64>,
    /// Velocity at the end of the sweep before, and how long before that was, s.
    pub previous: Option<(Vector3<f64>, f64)>,
    /// The gyro, where there is one, and its yaw bias.
    pub gyro: Option<(&'a Heading, f64)>,
    /// Roll and pitch.
    pub tilt: Tilt,
}

impl Motion<'_> {
    /// Velocity `s` seconds after the sweep's end (negative within the sweep).
    fn velocity_at(&self, s: f64) -> Vector3<f64> {
        match self.previous {
            Some((previous, dt)) => self.velocity + (self.velocity - previous) * (s / dt).max(-1.0),
            None => self.velocity,
        }
    }

    /// d velocity_at(s) / d velocity.
    fn share_at(&self, s: f64) -> f64 {
        self.previous
            .map_or(1.0, |(_, dt)| 1.0 + (s / dt).max(-1.0))
    }
}

/// Computes the pose of each beam, newest to oldest, by the midpoint rule from beam to beam.
pub fn beam_poses(
    scan: &Message<RadarPoints>,
    robot: &Robot,
    motion: Option<&Motion>,
    out: &mut Vec<BeamPose>,
) {
    let radar = Pose2::new(robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad);
    let tilt = motion.map_or(Tilt::LEVEL, |m| m.tilt);
    let end_ns = scan.head.sweep.end_ns;
    let end_heading = motion
        .and_then(|m| m.gyro)
        .and_then(|(heading, _)| heading.at(end_ns));
    let beams = scan.head.sweep.beams();
    out.clear();
    out.resize(beams.len(), BeamPose::default());
    let (mut position, mut yaw, mut lever, mut after) = (Vector2::zeros(), 0.0, 0.0, 0.0);
    for (beam, out) in beams.iter().zip(out).rev() {
        if let Some(motion) = motion {
            let s = (beam.stamp_ns - end_ns) as f64 * 1e-9;
            let (step, middle) = (after - s, 0.5 * (after + s));
            let velocity = motion.velocity_at(middle);
            let new_yaw = match (motion.gyro, end_heading) {
                (Some((heading, bias)), Some(end)) => {
                    heading.at(beam.stamp_ns).unwrap_or(end) - end - bias * s
                }
                _ => yaw - velocity.z * step,
            };
            let (sin, cos) = sin_cos(0.5 * (yaw + new_yaw));
            position -= Vector2::new(
                cos * velocity.x - sin * velocity.y,
                sin * velocity.x + cos * velocity.y,
            ) * step;
            lever -= motion.share_at(middle) * step;
            (yaw, after) = (new_yaw, s);
        }
        let robot = Pose2::new(position.x, position.y, yaw);
        let (sin, cos) = sin_cos(radar.yaw_rad + f64::from(beam.azimuth_rad));
        let direction = tilt.level(Vector2::new(cos, sin));
        out.origin = robot.transform(tilt.level(radar.translation()));
        out.direction = robot.rotation() * direction;
        out.lever_s = lever;
    }
}

/// Moves every return into the robot's frame at the sweep's end.
pub fn deskew(scan: &Message<RadarPoints>, beams: &[BeamPose], out: &mut Vec<Point>) {
    out.clear();
    out.extend(scan.items.iter().filter_map(|r| {
        let beam = beams.get(usize::from(r.beam))?;
        let position = beam.origin + beam.direction * f64::from(r.range_m);
        Some(Point {
            x_m: position.x,
            y_m: position.y,
            intensity: f64::from(r.intensity),
            lever_s: beam.lever_s,
            beam: r.beam,
        })
    }));
}

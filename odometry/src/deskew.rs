//! Removes the motion inside a sweep, beam by beam.
//!
//! A return measured at t < T, T the sweep's end, is moved into the robot's frame at T: rotation
//! from the integrated gyro, translation from the velocity, which runs straight from the last
//! scan's to this one's.

use crate::{gyro_integrator::GyroIntegrator, tilt::Tilt};
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
    pub velocity_jacobian_s: f64,
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
    pub velocity_jacobian_s: f64,
}

/// How the robot moved during a sweep, as far as is known.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Velocity at the sweep's end.
    pub velocity: Vector3<f64>,
    /// Velocity at the end of the sweep before, and how long before that was, s.
    pub previous: Option<(Vector3<f64>, f64)>,
    /// The gyro, where there is one, and its yaw bias.
    pub gyro: Option<(&'a GyroIntegrator, f64)>,
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
    let base_from_radar = Pose2::new(robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad);
    let tilt = motion.map_or(Tilt::LEVEL, |m| m.tilt);
    let end_ns = scan.head.sweep.end_ns;
    let end_heading = motion
        .and_then(|m| m.gyro)
        .and_then(|(gyro, _)| gyro.heading_rad(end_ns));
    let beams = scan.head.sweep.beams();
    out.clear();
    out.resize(beams.len(), BeamPose::default());
    let (mut position, mut yaw, mut velocity_jacobian_s, mut after) =
        (Vector2::zeros(), 0.0, 0.0, 0.0);
    for (beam, out) in beams.iter().zip(out).rev() {
        if let Some(motion) = motion {
            let stamp_ns = beam.stamp_ns.clamp(scan.head.sweep.begin_ns, end_ns);
            let s = (stamp_ns - end_ns) as f64 * 1e-9;
            let (step, middle) = (after - s, 0.5 * (after + s));
            let velocity = motion.velocity_at(middle);
            let new_yaw = match (motion.gyro, end_heading) {
                (Some((gyro, bias)), Some(end)) => {
                    gyro.heading_rad(stamp_ns).unwrap_or(end) - end - bias * s
                }
                _ => yaw - velocity.z * step,
            };
            let (sin, cos) = sin_cos(0.5 * (yaw + new_yaw));
            position -= Vector2::new(
                cos * velocity.x - sin * velocity.y,
                sin * velocity.x + cos * velocity.y,
            ) * step;
            velocity_jacobian_s -= motion.share_at(middle) * step;
            (yaw, after) = (new_yaw, s);
        }
        let end_from_base = Pose2::new(position.x, position.y, yaw);
        let (sin, cos) = sin_cos(base_from_radar.yaw_rad + f64::from(beam.azimuth_rad));
        let direction = tilt.level(Vector2::new(cos, sin));
        out.origin = end_from_base.transform(tilt.level(base_from_radar.translation()));
        out.direction = end_from_base.rotation() * direction;
        out.velocity_jacobian_s = velocity_jacobian_s;
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
            velocity_jacobian_s: beam.velocity_jacobian_s,
            beam: r.beam,
        })
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_geometry::elementary::{PI, atan2};
    use randt_messages::{Beam, Return};

    const BEAMS: usize = 200;
    const PERIOD_NS: i64 = 200_000_000;

    /// What a radar mounted at `radar` sees of fixed points while the robot drives an arc at a
    /// constant twist: the points are in the robot's frame at the sweep's end.
    fn sweep(points: &[Vector2<f64>], twist: Vector3<f64>, radar: &Pose2) -> Message<RadarPoints> {
        let mut scan = Message::<RadarPoints>::default();
        let sweep = &mut scan.head.sweep;
        (sweep.begin_ns, sweep.end_ns, sweep.beam_count) = (0, PERIOD_NS, BEAMS as u32);
        for beam in 0..BEAMS {
            let stamp_ns = PERIOD_NS * beam as i64 / BEAMS as i64;
            let s = (stamp_ns - PERIOD_NS) as f64 * 1e-9;
            let seen_from = Pose2::exp(twist * s).compose(radar);
            // One point a beam, wherever it lies: the direction is the beam's.
            let p = seen_from.inverse().transform(points[beam % points.len()]);
            sweep.beams[beam] = Beam {
                stamp_ns,
                azimuth_rad: atan2(p.y, p.x) as f32,
                first_return: beam as u32,
            };
            let range_m = p.norm() as f32;
            scan.items.push(Return {
                range_m,
                intensity: 9.0,
                beam: beam as u16,
                bin: 0,
            });
        }
        scan
    }

    proptest! {
        #[test]
        fn fixed_points_stand_where_they_are_at_the_sweeps_end(
            speed in -2.0..9.0, slip in -0.3..0.3, rate in -1.0..1.0, x in -0.5..0.5, yaw in -PI..PI,
        ) {
            let points: Vec<_> = (0..7).map(|i| Vector2::new(4.0 - f64::from(i), f64::from(i * i) * 0.3 - 2.0)).collect();
            let twist = Vector3::new(speed, slip, rate);
            let robot = Robot { radar_x_m: x, radar_y_m: -0.1, radar_yaw_rad: yaw, ..Robot::default() };
            let scan = sweep(&points, twist, &Pose2::new(x, -0.1, yaw));
            let motion = Motion { velocity: twist, previous: Some((twist, 0.2)), gyro: None, tilt: Tilt::LEVEL };
            let (mut beams, mut out) = (Vec::new(), Vec::new());
            beam_poses(&scan, &robot, Some(&motion), &mut beams);
            deskew(&scan, &beams, &mut out);
            prop_assert_eq!(out.len(), BEAMS);
            for (i, p) in out.iter().enumerate() {
                let truth = points[i % points.len()];
                // Single precision of range and azimuth, and the midpoint rule between beams.
                prop_assert!((Vector2::new(p.x_m, p.y_m) - truth).norm() < 2e-4, "beam {i}: {p:?} {truth}");
            }
        }

        #[test]
        fn the_velocity_jacobian_is_the_derivative_by_the_velocity(speed in 0.0..9.0, before in 0.0..9.0) {
            let points = [Vector2::new(3.0, 1.0)];
            let scan = sweep(&points, Vector3::new(speed, 0.0, 0.0), &Pose2::IDENTITY);
            let at = |speed: f64| {
                let velocity = Vector3::new(speed, 0.0, 0.0);
                let previous = Some((Vector3::new(before, 0.0, 0.0), 0.25));
                let motion = Motion { velocity, previous, gyro: None, tilt: Tilt::LEVEL };
                let (mut beams, mut out) = (Vec::new(), Vec::new());
                beam_poses(&scan, &Robot::default(), Some(&motion), &mut beams);
                deskew(&scan, &beams, &mut out);
                out
            };
            let h = 1e-3;
            let (low, middle, high) = (at(speed - h), at(speed), at(speed + h));
            for ((a, p), b) in low.iter().zip(&middle).zip(&high) {
                prop_assert!(((b.x_m - a.x_m) / (2.0 * h) - p.velocity_jacobian_s).abs() < 1e-9);
            }
        }
    }
}

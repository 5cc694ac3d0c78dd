//! `sensor_msgs/LaserScan`: an experiment, for what turns radars into one. It has one return a
//! beam, where a radar has many.

use super::cloud::{Cloud, Point, UNKNOWN_INTENSITY};
use super::wire::{Encoding, Malformed, Wire};
use randt_geometry::elementary::sin_cos;

impl Cloud {
    /// The points of a scan of ranges.
    pub fn decode_laser_scan(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        let (first_rad, _, step_rad) = (wire.f32()?, wire.f32()?, wire.f32()?);
        wire.f32()?; // time between rays, which drivers leave at 0
        wire.f32()?; // time of a turn, likewise
        let (least_m, most_m) = (wire.f32()?, wire.f32()?);
        let ranges_m = wire.sequence(4, Wire::f32)?;
        let intensities = wire.sequence(4, Wire::f32)?;
        if ranges_m.is_empty() || !step_rad.is_finite() || !first_rad.is_finite() {
            return Err(wire.malformed("a scan without ranges or angles"));
        }
        let has_intensity = intensities.len() == ranges_m.len();
        let mut cloud = Self {
            header,
            without_intensity: (!has_intensity).then(|| "ranges".to_owned()),
            ..Self::default()
        };
        for (index, range_m) in ranges_m.into_iter().enumerate() {
            // No echo is infinity, or a range out of limits.
            if !range_m.is_finite() || range_m < least_m || range_m > most_m {
                continue;
            }
            let angle_rad = f64::from(first_rad) + index as f64 * f64::from(step_rad);
            let (sin, cos) = sin_cos(angle_rad);
            let intensity = intensities.get(index).copied();
            cloud.points.push(Point {
                x_m: f64::from(range_m) * cos,
                y_m: f64::from(range_m) * sin,
                intensity: intensity.unwrap_or(UNKNOWN_INTENSITY),
            });
        }
        Ok(cloud)
    }
}

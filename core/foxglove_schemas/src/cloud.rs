//! `PointCloud`: a sweep's returns, all of them or those that the filter left.

use crate::{RADAR, packed_fields, pose_of, timestamp};
use foxglove::messages::PointCloud;
use foxglove::messages::packed_element_field::NumericType;
use randt_messages::{MessageRef, RadarPoints, RadarScan, Return, SweepHead};
use randt_ros_messages::{Style, directions};

/// Coordinates are whole numbers of this, m, about an iSDR-C's range bin: digits that no viewer
/// shows would double what the cloud takes on the disk.
const GRAIN_M: f64 = 1.0 / 64.0;
/// The same for intensities, in the sensor's unit.
const GRAIN: f64 = 1.0 / 4.0;

/// What the filter left, in the radar's frame, each return where its beam saw it: motion during
/// the sweep is not removed.
pub fn of_points(message: MessageRef<'_, RadarPoints>) -> PointCloud {
    of_some_points(message, usize::MAX)
}

/// The same, with every n-th return only, so that the data take at most `bytes_max` bytes.
pub fn of_some_points(message: MessageRef<'_, RadarPoints>, bytes_max: usize) -> PointCloud {
    let head = message.head;
    let count = (bytes_max / STRIDE).max(1);
    let step = message.items.len().div_ceil(count).max(1);
    cloud(head.header.stamp_ns, &head.sweep, message.items, step)
}

/// Every return of a sweep, likewise.
pub fn of_scan(message: MessageRef<'_, RadarScan>) -> PointCloud {
    let head = message.head;
    cloud(head.header.stamp_ns, &head.sweep, message.items, 1)
}

/// What the filter left for a recording, likewise.
pub fn recorded_points(message: MessageRef<'_, RadarPoints>) -> Vec<u8> {
    let header = message.head.header;
    let points = coarse_points(&message.head.sweep, message.items, 1);
    randt_ros_messages::cloud(Style::Cdr, header.sequence, header.stamp_ns, points)
}

fn cloud(stamp_ns: i64, sweep: &SweepHead, returns: &[Return], step: usize) -> PointCloud {
    let mut data = Vec::with_capacity(returns.len().div_ceil(step) * STRIDE);
    for [x_m, y_m, intensity] in coarse_points(sweep, returns, step) {
        for value in [x_m, y_m, 0.0, intensity] {
            data.extend(value.to_le_bytes());
        }
    }
    PointCloud {
        timestamp: timestamp(stamp_ns),
        frame_id: RADAR.to_owned(),
        pose: Some(pose_of([0.0; 3])),
        point_stride: STRIDE as u32,
        fields: packed_fields(&["x", "y", "z", "intensity"], NumericType::Float32, 4),
        data: data.into(),
    }
}

/// x, y, z, intensity: there are viewers that show no cloud without a z.
const STRIDE: usize = 16;

/// Every n-th return as x m, y m and intensity.
fn coarse_points(
    sweep: &SweepHead,
    returns: &[Return],
    step: usize,
) -> impl Iterator<Item = [f32; 3]> {
    let directions = directions(sweep);
    let points = returns.iter().step_by(step);
    points.filter_map(move |point| {
        let (sine, cosine) = directions.get(usize::from(point.beam))?;
        let range_m = f64::from(point.range_m);
        let [x_m, y_m] = [cosine, sine].map(|direction| coarse(range_m * direction, GRAIN_M));
        Some([x_m, y_m, coarse(f64::from(point.intensity), GRAIN)])
    })
}

fn coarse(value: f64, grain: f64) -> f32 {
    ((value / grain).round() * grain) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{Beam, Message, Return};

    #[test]
    fn returns_lie_in_their_beams_direction() {
        let mut points = Message::<RadarPoints>::default();
        points.head.sweep.beam_count = 2;
        points.head.sweep.beams[1] = Beam {
            azimuth_rad: core::f32::consts::FRAC_PI_2,
            ..Beam::default()
        };
        let at = |beam, range_m| Return {
            range_m,
            intensity: 9.6,
            beam,
            bin: 0,
        };
        // One that no beam has is left out.
        points.items = vec![at(0, 2.0), at(1, 3.003), at(7, 1.0)];
        let cloud = of_points(points.as_ref());
        let values: Vec<f32> = cloud
            .data
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        assert_eq!(cloud.point_stride, 16);
        assert_eq!(values, [2.0, 0.0, 0.0, 9.5, 0.0, 3.0, 0.0, 9.5]);
        let mut scan = Message::<RadarScan>::default();
        (scan.head.sweep, scan.items) = (points.head.sweep, points.items.clone());
        assert_eq!(of_scan(scan.as_ref()), cloud);
        // Thinned evenly.
        points.items = (0..100).map(|_| at(0, 2.0)).collect();
        assert_eq!(of_some_points(points.as_ref(), 800).data.len(), 800);
        assert_eq!(of_some_points(points.as_ref(), 799).data.len(), 34 * STRIDE);
        assert_eq!(of_some_points(points.as_ref(), 0).data.len(), STRIDE);
    }
}

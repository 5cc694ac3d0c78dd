//! ScanContext (Kim and Kim 2018) on intensities: what a scan looks like from above, under any
//! heading.
//!
//! The plane around the robot is cut into rings and sectors; an element is the sum of its returns'
//! intensities. Sectors are compared by their cosine, so the unit of the intensity does not
//! matter.

use randt_config::Loops;
use randt_geometry::elementary::{PI, atan2};
use randt_messages::KeyframePoint;
use randt_persist::persist;

/// The descriptor of one keyframe.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanContext {
    rings: usize,
    /// Unit columns, sector by sector; all zero where a sector is empty.
    columns: Vec<f32>,
}

/// Share of each ring in the intensity: the same under every heading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RingKey {
    shares: Vec<f32>,
}
persist!(RingKey { shares });

/// How alike two descriptors are, and under which turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// 1 - mean cosine of the columns, 0..1.
    pub distance: f64,
    /// Heading of the second in the frame of the first, to half a sector.
    pub yaw_rad: f64,
}

impl ScanContext {
    /// The descriptor of de-skewed returns, and its key.
    pub fn new(points: &[KeyframePoint], config: &Loops) -> (Self, RingKey) {
        let (rings, sectors) = (config.rings as usize, config.sectors as usize);
        let mut columns = vec![0.0_f32; rings * sectors];
        for point in points {
            let (x, y) = (f64::from(point.x_m), f64::from(point.y_m));
            let ring = ((x * x + y * y).sqrt() / config.radius_m * rings as f64) as usize;
            if ring >= rings || !point.intensity.is_finite() {
                continue;
            }
            let turn = (atan2(y, x) + PI) / (2.0 * PI);
            let sector = ((turn * sectors as f64) as usize).min(sectors - 1);
            if let Some(element) = columns.get_mut(sector * rings + ring) {
                *element += point.intensity.max(0.0);
            }
        }
        let mut shares = vec![0.0_f32; rings];
        for column in columns.chunks_exact(rings) {
            for (sum, element) in shares.iter_mut().zip(column) {
                *sum += element;
            }
        }
        normalise(&mut shares);
        columns.chunks_exact_mut(rings).for_each(normalise);
        (Self { rings, columns }, RingKey { shares })
    }

    /// The best of all turns.
    pub fn compare(&self, other: &Self) -> Likeness {
        let sectors = self.columns.len() / self.rings.max(1);
        let mut best = (f32::NEG_INFINITY, 0);
        for shift in 0..sectors {
            // Sector j of the second lies where sector j + shift of the first does.
            let (tail, front) = self.columns.split_at(shift * self.rings);
            let rest = front.len().min(other.columns.len());
            let (a, b) = other.columns.split_at(rest);
            let cosine = dot(front, a) + dot(tail, b);
            if cosine > best.0 {
                best = (cosine, shift);
            }
        }
        Likeness {
            distance: 1.0 - f64::from(best.0) / sectors.max(1) as f64,
            yaw_rad: best.1 as f64 / sectors.max(1) as f64 * 2.0 * PI,
        }
    }
}

impl RingKey {
    /// Squared distance: a first sieve, cheap and blind to the heading.
    pub fn distance(&self, other: &Self) -> f32 {
        let pairs = self.shares.iter().zip(&other.shares);
        pairs.map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

/// Scales to length 1; nothing stays nothing.
fn normalise(values: &mut [f32]) {
    let norm = dot(values, values).sqrt();
    if norm > 0.0 {
        values.iter_mut().for_each(|value| *value /= norm);
    }
}

/// Sum of products in eight lanes: a fixed order that the compiler can put into vectors.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += a * b;
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h)) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_geometry::Pose2;

    /// A room whose walls differ, seen from a pose in it.
    fn view(pose: &Pose2) -> Vec<KeyframePoint> {
        let inverse = pose.inverse();
        (0..2000)
            .map(|i| {
                let s = f64::from(i % 500) * 0.02;
                let (p, intensity) = match i / 500 {
                    0 => ([s - 5.0, 4.0], 9.0),
                    1 => ([s - 5.0, -3.0], 14.0),
                    2 => ([6.0, s - 5.0], 20.0),
                    _ => ([-4.0, s * 0.5 - 1.0], 11.0),
                };
                let p = inverse.transform(p.into());
                KeyframePoint {
                    x_m: p.x as f32,
                    y_m: p.y as f32,
                    intensity,
                    beam: 0,
                    reserved: 0,
                }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn the_same_spot_under_another_heading_is_found_with_its_turn(yaw in -PI..PI, x in -0.2..0.2, y in -0.2..0.2) {
            let config = Loops::default();
            let (first, _) = ScanContext::new(&view(&Pose2::IDENTITY), &config);
            let (second, _) = ScanContext::new(&view(&Pose2::new(x, y, yaw)), &config);
            let likeness = first.compare(&second);
            // Another spot in the same room is less alike.
            let (other, _) = ScanContext::new(&view(&Pose2::new(3.0, 2.0, yaw)), &config);
            prop_assert!(likeness.distance < 0.9 * first.compare(&other).distance, "{likeness:?}");
            let off = randt_geometry::elementary::wrap(likeness.yaw_rad - yaw);
            prop_assert!(off.abs() < 1.6 * 2.0 * PI / f64::from(config.sectors), "{likeness:?} {yaw}");
        }
    }

    #[test]
    fn nothing_and_hostile_points_have_a_descriptor() {
        let config = Loops::default();
        let (none, _) = ScanContext::new(&[], &config);
        let hostile: Vec<_> = [f32::NAN, f32::INFINITY, -1.0, 1e30]
            .iter()
            .map(|&v| KeyframePoint {
                x_m: v,
                y_m: 1.0,
                intensity: v,
                beam: 0,
                reserved: 0,
            })
            .collect();
        let (odd, _) = ScanContext::new(&hostile, &config);
        assert!((0.0..=1.0).contains(&none.compare(&odd).distance));
    }
}

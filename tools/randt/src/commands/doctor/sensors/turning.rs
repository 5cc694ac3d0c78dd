//! Whether radar and gyro turn the same way: a robot whose radar is read in a mirror drives into
//! walls.
//!
//! Responsible for the radar's own turn from sweep to sweep, coarse but sure of its sign. Not
//! responsible for exact motion: odometry is.

use randt_messages::{MessageRef, RadarScan};

/// Sectors of a sweep: of two degrees, about a beam's width.
const SECTORS: usize = 180;
/// A turn from one sweep to the next is looked for up to this many sectors: 60 degrees in a fifth
/// of a second.
const TURN_MAX: i32 = 30;
/// The robot must have turned this far in all before there is an answer, rad: 20 degrees.
const TURN_MIN_RAD: f64 = 0.35;
/// The shares of the gyro's turn within which the radar's agrees.
const AGREES: std::ops::Range<f64> = 0.5..1.5;

/// What a sweep looks like all around: mean of the logarithm of range by sector, its own mean
/// removed.
#[derive(Clone, Debug)]
pub struct Panorama {
    /// The sweep's end.
    pub stamp_ns: i64,
    sectors: [f32; SECTORS],
}

impl Panorama {
    /// Of one sweep.
    pub fn from_scan(scan: MessageRef<'_, RadarScan>) -> Self {
        let sweep = &scan.head.sweep;
        let (mut sums, mut counts) = ([0.0_f32; SECTORS], [0.0_f32; SECTORS]);
        for (index, beam) in sweep.beams().iter().enumerate() {
            let share = (f64::from(beam.azimuth_rad) / std::f64::consts::TAU).rem_euclid(1.0);
            let sector = ((share * SECTORS as f64) as usize).min(SECTORS - 1);
            let range = sweep.returns_of(index, scan.items.len());
            let returns = scan.items.get(range).unwrap_or_default();
            // The strongest echo of a beam is a wall more often than not.
            let strongest = returns
                .iter()
                .max_by(|a, b| a.intensity.total_cmp(&b.intensity));
            if let (Some(found), Some(sum), Some(count)) =
                (strongest, sums.get_mut(sector), counts.get_mut(sector))
            {
                *sum += found.range_m.max(0.1).log2();
                *count += 1.0;
            }
        }
        let filled: f32 = counts.iter().filter(|count| **count > 0.0).count() as f32;
        let mut sectors = [0.0; SECTORS];
        let mut mean = 0.0;
        for ((value, sum), count) in sectors.iter_mut().zip(sums).zip(counts) {
            if count > 0.0 {
                *value = sum / count;
                mean += *value / filled;
            }
        }
        for (value, count) in sectors.iter_mut().zip(counts) {
            *value = if count > 0.0 { *value - mean } else { 0.0 };
        }
        Self {
            stamp_ns: scan.header().stamp_ns,
            sectors,
        }
    }

    /// How far the radar has turned since another sweep, counter-clockwise, rad: the turn at which
    /// both look alike.
    fn turn_since(&self, other: &Self) -> f64 {
        // What stands still moves clockwise in the view of a radar that turns counter-clockwise.
        let likeness = |turn: i32| -> f32 {
            let shift = turn.rem_euclid(SECTORS as i32) as usize;
            let before = other.sectors.iter().cycle().skip(shift);
            self.sectors
                .iter()
                .zip(before)
                .map(|(now, before)| now * before)
                .sum()
        };
        let all = -TURN_MAX..=TURN_MAX;
        let best = all
            .max_by(|a, b| likeness(*a).total_cmp(&likeness(*b)))
            .unwrap_or(0);
        f64::from(best) * std::f64::consts::TAU / SECTORS as f64
    }
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sense {
    /// The robot has not turned enough for an answer: gyro's turns added up without sign, rad.
    TooLittle(f64),
    /// Radar and gyro agree: the radar's share of the gyro's turn.
    Agrees(f64),
    /// They turn against each other: one of them is mirrored or upside down.
    Opposed(f64),
    /// Neither: the radar sees no structure, or moves on the robot.
    Unclear(f64),
}

/// Compares sweeps with the gyro's heading, given at any time.
pub fn sense(sweeps: &[Panorama], heading_rad: impl Fn(i64) -> f64) -> Sense {
    let (mut product, mut square, mut turned_rad) = (0.0, 0.0, 0.0);
    for pair in sweeps.windows(2) {
        let [before, now] = pair else { continue };
        let gyro_rad = heading_rad(now.stamp_ns) - heading_rad(before.stamp_ns);
        product += gyro_rad * now.turn_since(before);
        square += gyro_rad * gyro_rad;
        turned_rad += gyro_rad.abs();
    }
    if turned_rad < TURN_MIN_RAD {
        return Sense::TooLittle(turned_rad);
    }
    match product / square {
        share if AGREES.contains(&share) => Sense::Agrees(share),
        share if AGREES.contains(&-share) => Sense::Opposed(share),
        share => Sense::Unclear(share),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::wrap;
    use randt_simulator::{Event, Robot, Simulation, World};

    /// Sweeps of a drive, mirrored or not, with the true heading.
    fn sense_of_drive(mirrored: bool, scans: usize) -> Sense {
        let (mut sweeps, mut headings, mut unwrapped) = (Vec::new(), Vec::new(), 0.0);
        for event in Simulation::new(&World::building(), Robot::default(), scans as u64, 5) {
            match event {
                Event::Scan(mut scan) => {
                    let count = scan.head.sweep.beam_count as usize;
                    for beam in scan.head.sweep.beams.iter_mut().take(count) {
                        beam.azimuth_rad *= if mirrored { -1.0 } else { 1.0 };
                    }
                    sweeps.push(Panorama::from_scan(scan.as_ref()));
                }
                Event::Truth(truth) => {
                    unwrapped += wrap(truth.pose[2] - unwrapped);
                    headings.push((truth.header.stamp_ns, unwrapped));
                }
                Event::Imu(_) | Event::Twist(_) => {}
            }
        }
        sense(&sweeps, |stamp_ns| {
            let after = headings.partition_point(|(at_ns, _)| *at_ns < stamp_ns);
            headings[after.min(headings.len() - 1)].1
        })
    }

    #[test]
    fn a_mirrored_radar_is_detected() {
        assert!(
            matches!(sense_of_drive(false, 300), Sense::Agrees(_)),
            "{:?}",
            sense_of_drive(false, 300)
        );
        assert!(
            matches!(sense_of_drive(true, 300), Sense::Opposed(_)),
            "{:?}",
            sense_of_drive(true, 300)
        );
        assert!(matches!(sense_of_drive(false, 5), Sense::TooLittle(_)));
    }
}

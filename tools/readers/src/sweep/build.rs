//! One sweep's message from its points.

use super::learn::{Turn, ahead, resultant};
use super::polar::{Cluster, Polar, PolarPoint, clusters};
use crate::{counters::Counters, limit::strongest};
use randt_geometry::elementary::{PI, wrap};
use randt_messages::{Beam, MAX_BEAMS, MAX_RETURNS, Message, RadarScan, Return};

/// A beam in the sweep.
struct BeamSlot {
    /// Fraction of the turn at the beam's middle, 0..1.
    turn_fraction: f64,
    azimuth_rad: f64,
}

impl Turn {
    /// Makes the message of one sweep; repairs and losses are counted.
    pub fn build(
        &self,
        mut polar: Polar,
        sequence: u64,
        counters: &mut Counters,
    ) -> Message<RadarScan> {
        keep_strongest(&mut polar, counters);
        let start_rad = self.start_of(&polar);
        let clusters = self.in_order(&mut polar.points, start_rad, counters);
        let (slots, owners) = self.slots(&clusters, start_rad, counters);

        let mut message = Message::<RadarScan>::default();
        let (begin_ns, end_ns) = self.interval(polar.stamp_ns);
        let head = &mut *message.head;
        head.header.sequence = sequence;
        head.header.stamp_ns = end_ns;
        let sweep = &mut head.sweep;
        (sweep.begin_ns, sweep.end_ns) = (begin_ns, end_ns);
        sweep.sensor = self.sensor() as u32;
        sweep.returns_dropped = polar.dropped;
        sweep.range_resolution_m = self.bins.resolution_m as f32;
        sweep.azimuth_step_rad = self.step_rad as f32;
        sweep.beam_count = slots.len().min(MAX_BEAMS) as u32;

        let mut owned = clusters.iter().zip(owners).peekable();
        for (index, (slot, beam)) in slots.iter().zip(&mut sweep.beams).enumerate() {
            let first = message.items.len();
            *beam = Beam {
                stamp_ns: begin_ns + (slot.turn_fraction * self.period_ns as f64).round() as i64,
                azimuth_rad: wrap_f32(slot.azimuth_rad),
                first_return: first as u32,
            };
            let mut cluster_count = 0;
            while let Some((cluster, _)) = owned.next_if(|(_, owner)| *owner == index) {
                let points = polar.points.get(cluster.points.clone()).unwrap_or_default();
                message.items.extend(points.iter().map(|point| Return {
                    range_m: point.range_m as f32,
                    intensity: point.intensity,
                    beam: index as u16,
                    bin: self.bin(point.range_m),
                }));
                cluster_count += 1;
            }
            if cluster_count > 1
                && let Some(beam) = message.items.get_mut(first..)
            {
                beam.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
            }
        }
        message
    }

    /// First and last instant of a sweep with this stamp.
    fn interval(&self, stamp_ns: i64) -> (i64, i64) {
        self.stamp.interval(stamp_ns, self.period_ns)
    }

    fn start_of(&self, polar: &Polar) -> f64 {
        let first = polar.points.first().map(|point| point.azimuth_rad);
        self.start_azimuth_rad.or(first).unwrap_or(-PI)
    }

    /// Angle from the start in the sense of rotation, from half a step before the first beam.
    fn angle(&self, azimuth_rad: f64, start_rad: f64) -> f64 {
        match ahead(start_rad, azimuth_rad, self.clockwise) {
            angle if angle >= 2.0 * PI - 0.5 * self.step_rad => angle - 2.0 * PI,
            angle => angle,
        }
    }

    /// Clusters in order of time, each by range; sorts the points where they are not so.
    fn in_order(
        &self,
        points: &mut [PolarPoint],
        start_rad: f64,
        counters: &mut Counters,
    ) -> Vec<Cluster> {
        let angle = |azimuth_rad: f64| self.angle(azimuth_rad, start_rad);
        let mut found = clusters(points);
        if !found.is_sorted_by(|a, b| angle(a.azimuth_rad) <= angle(b.azimuth_rad)) {
            counters.count_event("sweeps_sorted", 1, || {
                format!("{} points not in order of azimuth", points.len())
            });
            points.sort_by(|a, b| angle(a.azimuth_rad).total_cmp(&angle(b.azimuth_rad)));
            found = clusters(points);
        }
        for cluster in &found {
            if let Some(beam) = points.get_mut(cluster.points.clone())
                && !beam.is_sorted_by(|a, b| a.range_m <= b.range_m)
            {
                beam.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
            }
        }
        found
    }

    /// The beams of the sweep, and for each cluster the beam that it belongs to.
    fn slots(
        &self,
        clusters: &[Cluster],
        start_rad: f64,
        counters: &mut Counters,
    ) -> (Vec<BeamSlot>, Vec<usize>) {
        let angle = |cluster: &Cluster| self.angle(cluster.azimuth_rad, start_rad);
        let angles: Vec<f64> = clusters.iter().map(angle).collect();
        let sense = if self.clockwise { -1.0 } else { 1.0 };
        let count = match self.grid {
            Some(count) => count as usize,
            // No grid and more directions than the table holds: the table's own sectors.
            None if clusters.len() > MAX_BEAMS => {
                let count = clusters.len();
                let first = || format!("{count} directions in a sweep, {MAX_BEAMS} at most");
                counters.count_event("sweeps_regridded", 1, first);
                MAX_BEAMS
            }
            None => {
                let slot = |(cluster, angle): (&Cluster, &f64)| BeamSlot {
                    turn_fraction: ((angle + 0.5 * self.step_rad) / (2.0 * PI)).clamp(0.0, 1.0),
                    azimuth_rad: cluster.azimuth_rad,
                };
                let slots = clusters.iter().zip(&angles).map(slot);
                return (slots.collect(), (0..clusters.len()).collect());
            }
        };
        let step = 2.0 * PI / count as f64;
        // The sweep's own phase against the grid, in steps: a turntable need not stop where it
        // began.
        let (_, phase) = resultant(angles.iter().map(|angle| angle * count as f64));
        let phase = phase / (2.0 * PI);
        let mut slots: Vec<BeamSlot> = (0..count)
            .map(|index| BeamSlot {
                turn_fraction: (index as f64 + 0.5) / count as f64,
                azimuth_rad: start_rad + sense * (index as f64 + phase) * step,
            })
            .collect();
        let mut owners = Vec::with_capacity(clusters.len());
        for (cluster, angle) in clusters.iter().zip(&angles) {
            // Rounding cannot leave the table by more than the half step at the seam.
            let index = (angle / step - phase).round();
            let index = index.clamp(0.0, (count - 1) as f64) as usize;
            if let (Some(slot), Some(_)) = (slots.get_mut(index), self.grid) {
                slot.azimuth_rad = cluster.azimuth_rad;
            }
            owners.push(index);
        }
        (slots, owners)
    }

    fn bin(&self, range_m: f64) -> u16 {
        if self.bins.resolution_m <= 0.0 {
            return 0;
        }
        // `as` saturates at both ends.
        ((range_m - self.bins.offset_m) / self.bins.resolution_m).round() as u16
    }
}

/// An azimuth as f32 in [-pi, pi).
pub(crate) fn wrap_f32(azimuth_rad: f64) -> f32 {
    match wrap(azimuth_rad) as f32 {
        // The f32 next to pi is above pi.
        azimuth if f64::from(azimuth) >= PI => -azimuth,
        azimuth => azimuth,
    }
}

/// Leaves the strongest returns where there are more than a message holds; order and ties as they
/// stand.
fn keep_strongest(polar: &mut Polar, counters: &mut Counters) {
    let count = polar.points.len();
    let Some(over) = count.checked_sub(MAX_RETURNS).filter(|over| *over > 0) else {
        return;
    };
    counters.count_loss("returns_over_limit", over as u64, || {
        format!("{count} returns in a sweep, {MAX_RETURNS} at most: the strongest are kept")
    });
    polar.dropped = polar.dropped.saturating_add(over as u32);
    polar.points = strongest(&polar.points, |point| point.intensity);
}

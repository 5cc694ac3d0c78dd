//! The beam-wise cluster filter: of every beam only the strongest echo, with its flanks.
//!
//! Responsible for choosing returns, scan by scan, without memory of earlier scans. Not responsible for
//! motion inside the sweep: points stay polar, and keep their beam's time and azimuth.

use randt_messages::{Header, Message, MessageRef, RadarPoints, RadarScan, Return, Topic};

/// Reduces a sweep to one cluster of returns a beam (RaNDT SLAM, III-A).
///
/// Per beam: the strongest return between the range limits, and from it inwards and outwards as long as the
/// intensity strictly falls and neighbours are connected in range; of these the ones above the threshold.
/// Multipath, echoes through walls and the receiver's noise lie behind or between and fall away.
///
/// ```
/// use randt_filter::ClusterFilter;
/// use randt_messages::{Message, RadarPoints, RadarScan, Return};
///
/// let mut scan = Message::<RadarScan>::default();
/// scan.head.sweep.beam_count = 1;
/// for (bin, intensity) in [(200, 3.0), (201, 9.0), (202, 12.0), (203, 8.0), (300, 10.0)] {
///     let range_m = f32::from(bin) * 0.0161;
///     scan.items.push(Return { range_m, intensity, beam: 0, bin });
/// }
/// let mut filter = ClusterFilter::new(&Default::default(), &Default::default());
/// let mut points = Message::<RadarPoints>::default();
/// filter.process(scan.as_ref(), &mut points);
/// let bins: Vec<u16> = points.items.iter().map(|point| point.bin).collect();
/// assert_eq!(bins, [201, 202, 203]);
/// ```
#[derive(Clone, Debug)]
pub struct ClusterFilter {
    range_min_m: f32,
    range_max_m: f32,
    intensity_min: f32,
    connectivity_m: f32,
    sequence: u64,
}

impl ClusterFilter {
    /// A filter for one environment and one sensor.
    pub fn new(filter: &randt_config::Filter, sensor: &randt_config::Sensor) -> Self {
        Self {
            range_min_m: sensor.range_min_m as f32,
            range_max_m: filter.range_max_m.min(sensor.range_max_m) as f32,
            intensity_min: sensor.intensity_min as f32,
            connectivity_m: sensor.connectivity_m as f32,
            sequence: 0,
        }
    }

    /// Filters one sweep into `points`, whatever that held before.
    ///
    /// Times, beam table and counters are the sweep's, `first_return` counts the points.
    /// Epoch and publish time are left to who publishes. Broken input (table entries that go back, ranges out
    /// of order, values that are not finite) costs the returns concerned and nothing else.
    /// Reuse `points`: the first call reserves all that later ones can need.
    pub fn process(&mut self, scan: MessageRef<RadarScan>, points: &mut Message<RadarPoints>) {
        let missing = RadarPoints::MAX_ITEMS.saturating_sub(points.items.len());
        points.items.reserve_exact(missing);
        points.items.clear();

        let head = &mut *points.head;
        head.header = Header {
            sequence: self.sequence,
            stamp_ns: scan.head.header.stamp_ns,
            epoch: 0,
            published_ns: 0,
        };
        self.sequence += 1;
        head.scan_sequence = scan.head.header.sequence;
        head.scan_epoch = scan.head.header.epoch;
        head.scan_published_ns = scan.head.header.published_ns;
        head.sweep = scan.head.sweep;

        let total = scan.items.len().min(RadarScan::MAX_ITEMS);
        let count = scan.head.sweep.beams().len();
        head.sweep.beam_count = count as u32;
        let mut taken = 0;
        for (index, beam) in head.sweep.beams.iter_mut().take(count).enumerate() {
            beam.first_return = points.items.len() as u32;
            let range = scan.head.sweep.returns_of(index, total);
            // A table that goes back must not use a return twice.
            let range = range.start.max(taken)..range.end.max(taken);
            taken = range.end;
            let returns = scan.items.get(range).unwrap_or_default();
            let kept = self.cluster(returns).iter();
            points
                .items
                .extend(
                    kept.filter(|r| r.intensity > self.intensity_min)
                        .map(|r| Return {
                            beam: index as u16,
                            ..*r
                        }),
                );
        }
    }

    /// The strongest return of a beam with its flanks; empty where none is between the limits.
    fn cluster<'a>(&self, beam: &'a [Return]) -> &'a [Return] {
        let Some((peak, strongest)) = self.strongest(beam) else {
            return &[];
        };
        // Counts the neighbours that follow on one side; `sign` makes the step positive outwards from the peak.
        let flank = |side: &mut dyn Iterator<Item = &Return>, sign: f32| {
            let mut last = strongest;
            side.take_while(|next| {
                let step = sign * (next.range_m - last.range_m);
                let connected = (0.0..=self.connectivity_m).contains(&step);
                let belongs =
                    connected && next.intensity < last.intensity && self.in_limits(next.range_m);
                last = next;
                belongs
            })
            .count()
        };
        let inwards = flank(&mut beam.iter().take(peak).rev(), -1.0);
        let outwards = flank(&mut beam.iter().skip(peak + 1), 1.0);
        beam.get(peak - inwards..=peak + outwards)
            .unwrap_or_default()
    }

    /// The strongest return between the limits with its index; the first of equals.
    fn strongest<'a>(&self, beam: &'a [Return]) -> Option<(usize, &'a Return)> {
        let mut best: Option<(usize, &Return)> = None;
        for (index, candidate) in beam.iter().enumerate() {
            // A NaN is never greater and an infinite value is no measurement.
            let floor = best.map_or(self.intensity_min, |(_, b)| b.intensity);
            if candidate.intensity > floor
                && candidate.intensity.is_finite()
                && self.in_limits(candidate.range_m)
            {
                best = Some((index, candidate));
            }
        }
        best
    }

    fn in_limits(&self, range_m: f32) -> bool {
        range_m > self.range_min_m && range_m < self.range_max_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_messages::MAX_BEAMS;

    fn filter() -> ClusterFilter {
        ClusterFilter::new(&Default::default(), &Default::default())
    }

    /// A sweep of these beams, each a list of (range, intensity).
    fn sweep(beams: &[&[(f32, f32)]]) -> Message<RadarScan> {
        let mut scan = Message::<RadarScan>::default();
        scan.head.sweep.beam_count = beams.len() as u32;
        for (index, beam) in beams.iter().enumerate() {
            scan.head.sweep.beams[index].first_return = scan.items.len() as u32;
            scan.items
                .extend(beam.iter().map(|&(range_m, intensity)| Return {
                    range_m,
                    intensity,
                    beam: index as u16,
                    bin: 0,
                }));
        }
        scan
    }

    fn filtered(scan: &Message<RadarScan>) -> Message<RadarPoints> {
        let mut points = Message::default();
        filter().process(scan.as_ref(), &mut points);
        points
    }

    fn kept(beam: &[(f32, f32)]) -> Vec<(f32, f32)> {
        let points = filtered(&sweep(&[beam]));
        points
            .items
            .iter()
            .map(|p| (p.range_m, p.intensity))
            .collect()
    }

    #[test]
    fn the_strongest_with_both_flanks_is_kept() {
        let beam = [
            (2.00, 9.0),
            (2.02, 8.0),
            (2.04, 12.0),
            (2.06, 20.0),
            (2.08, 11.0),
            (2.10, 7.0),
            (2.12, 9.0),
        ];
        assert_eq!(kept(&beam), beam[1..6]);
    }

    #[test]
    fn a_gap_ends_the_cluster_on_either_side() {
        let beam = [
            (2.00, 9.0),
            (2.05, 12.0),
            (2.07, 20.0),
            (2.09, 11.0),
            (2.14, 7.0),
        ];
        assert_eq!(kept(&beam), beam[1..4]);
    }

    #[test]
    fn equal_neighbours_end_the_cluster_and_the_nearest_of_equal_peaks_wins() {
        let beam = [(2.00, 12.0), (2.02, 12.0), (2.04, 8.0)];
        assert_eq!(kept(&beam), beam[..1]);
    }

    #[test]
    fn the_flanks_below_the_threshold_and_beyond_the_limits_are_left_out() {
        let beam = [
            (0.59, 50.0),
            (0.61, 30.0),
            (0.63, 40.0),
            (0.65, 6.0),
            (0.67, 5.0),
        ];
        assert_eq!(kept(&beam), beam[1..3]);
        assert_eq!(kept(&[(16.0, 50.0), (3.0, 6.0)]), []);
    }

    #[test]
    fn every_beam_counts_even_the_last_and_the_table_is_indexed_anew() {
        let mut scan = sweep(&[
            &[(2.00, 5.0), (2.02, 9.0)],
            &[],
            &[(3.0, 9.0), (3.02, 8.0), (9.0, 7.0)],
            &[(4.0, 9.0)],
        ]);
        scan.head.header.sequence = 7;
        scan.head.header.stamp_ns = 9_000;
        scan.head.sweep.beams[2].stamp_ns = 8_000;
        scan.head.sweep.beams_lost = 3;
        let points = filtered(&scan);
        let firsts: Vec<u32> = points
            .head
            .sweep
            .beams()
            .iter()
            .map(|b| b.first_return)
            .collect();
        assert_eq!(firsts, [0, 1, 1, 3]);
        assert_eq!(points.items.len(), 4);
        assert_eq!(points.items[3].beam, 3);
        assert_eq!(
            (points.head.scan_sequence, points.head.header.stamp_ns),
            (7, 9_000)
        );
        assert_eq!(points.head.sweep.beams[2].stamp_ns, 8_000);
        assert_eq!(points.head.sweep.beams_lost, 3);
    }

    #[test]
    fn own_messages_are_counted() {
        let mut filter = filter();
        let mut points = Message::default();
        for sequence in 0..3 {
            filter.process(sweep(&[&[(2.0, 9.0)]]).as_ref(), &mut points);
            assert_eq!(points.head.header.sequence, sequence);
            assert_eq!(points.items.len(), 1);
        }
    }

    #[test]
    fn values_that_are_not_finite_cost_only_themselves() {
        let nan = f32::NAN;
        let beam = [
            (1.0, f32::INFINITY),
            (nan, 50.0),
            (2.00, nan),
            (2.02, 9.0),
            (nan, 8.0),
            (2.06, 7.0),
        ];
        assert_eq!(kept(&beam), beam[3..4]);
    }

    proptest! {
        #[test]
        fn broken_tables_and_values_give_each_return_at_most_once(
            firsts in prop::collection::vec(0_u32..200, 0..40),
            beam_count in 0_u32..2 * MAX_BEAMS as u32,
            values in prop::collection::vec((0.0_f32..20.0, 0.0_f32..30.0), 0..150),
        ) {
            let mut scan = sweep(&[&values]);
            scan.head.sweep.beam_count = beam_count;
            for (beam, first) in scan.head.sweep.beams.iter_mut().zip(&firsts) {
                beam.first_return = *first;
            }
            for (bin, r) in scan.items.iter_mut().enumerate() {
                r.bin = bin as u16;
            }
            let points = filtered(&scan);
            prop_assert!(points.items.windows(2).all(|w| w[0].bin < w[1].bin));
            let mut seen = 0;
            for beam in 0..points.head.sweep.beams().len() {
                let range = points.head.sweep.returns_of(beam, points.items.len());
                prop_assert_eq!(range.start, seen);
                seen = range.end;
                prop_assert!(points.items[range].iter().all(|p| p.beam as usize == beam));
            }
            prop_assert!(points.head.sweep.beams().is_empty() || seen == points.items.len());
        }
    }
}

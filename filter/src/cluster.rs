//! The beam-wise cluster filter (RaNDT, III-A): of every beam only the strongest echo, with its
//! flanks.
//!
//! Responsible for choosing returns, scan by scan, without memory of earlier scans. Not
//! responsible for motion inside the sweep: points stay polar, and keep their beam's time and
//! azimuth.

use core::ops::Range;
use randt_messages::{
    Header, MAX_BEAMS, Message, MessageRef, PointsHead, RadarPoints, RadarScan, Return, Topic,
};

/// Reduces a sweep to one cluster of returns a beam (RaNDT SLAM, III-A).
///
/// Per beam: the strongest return between the range limits, and from it inwards and outwards as
/// long as the intensity strictly falls and neighbours are connected in range; of these the ones
/// above the threshold. Multipath, echoes through walls and the receiver's noise lie behind or
/// between and fall away.
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
    /// Sweeps so far.
    sequence: u64,
    /// Those of the sweep at hand, beam by beam.
    clusters: Vec<Cluster>,
}

/// What is kept of a beam.
#[derive(Clone, Debug)]
struct Cluster {
    /// The sweep's returns that belong to it, those below the threshold included.
    returns: Range<usize>,
    /// Index of its first point.
    first_point: u32,
}

/// A sweep that was filtered, to be laid out where its readers find it.
#[derive(Debug)]
pub struct FilteredSweep<'a> {
    filter: &'a ClusterFilter,
    scan: MessageRef<'a, RadarScan>,
    /// How many points there are: the items of the message.
    pub len: usize,
}

impl FilteredSweep<'_> {
    /// Lays out the head of the message. Epoch and publish time are left to the publisher.
    pub fn write_head(&self, head: &mut PointsHead) {
        let scan = self.scan.head;
        head.header = Header {
            sequence: self.filter.sequence - 1,
            stamp_ns: scan.header.stamp_ns,
            ..Header::default()
        };
        head.scan_sequence = scan.header.sequence;
        head.scan_epoch = scan.header.epoch;
        head.scan_published_ns = scan.header.published_ns;
        head.sweep = scan.sweep;
        let clusters = &self.filter.clusters;
        head.sweep.beam_count = clusters.len() as u32;
        for (beam, cluster) in head.sweep.beams.iter_mut().zip(clusters) {
            beam.first_return = cluster.first_point;
        }
    }

    /// Lays out the items of the message, `len` of them.
    pub fn write_items(&self, points: &mut [Return]) {
        let mut points = points.iter_mut();
        for (cluster, beam) in self.filter.clusters.iter().zip(0..) {
            let kept = self.filter.kept(self.scan.items, &cluster.returns);
            for (from, to) in kept.zip(&mut points) {
                *to = Return { beam, ..*from };
            }
        }
    }
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
            clusters: Vec::with_capacity(MAX_BEAMS),
        }
    }

    /// Filters one sweep. Broken input (table entries that go back, ranges out of order, values
    /// that are not finite) costs the returns concerned and nothing else.
    ///
    /// Times, beam table and counters are the sweep's, `first_return` counts the points.
    pub fn filter<'a>(&'a mut self, scan: MessageRef<'a, RadarScan>) -> FilteredSweep<'a> {
        let total = scan.items.len().min(RadarScan::MAX_ITEMS);
        self.clusters.clear();
        let mut taken = 0;
        let mut len = 0;
        for index in 0..scan.head.sweep.beams().len() {
            let range = scan.head.sweep.returns_of(index, total);
            // A table that goes back must not use a return twice.
            let range = range.start.max(taken)..range.end.max(taken);
            taken = range.end;
            let begin = range.start;
            let cluster = self.cluster(scan.items.get(range).unwrap_or_default());
            let returns = begin + cluster.start..begin + cluster.end;
            let first_point = len as u32;
            len += self.kept(scan.items, &returns).count();
            self.clusters.push(Cluster {
                returns,
                first_point,
            });
        }
        self.sequence += 1;
        FilteredSweep {
            filter: self,
            scan,
            len,
        }
    }

    /// Filters one sweep into `points`, replacing what that held before. Reuse `points`: the first
    /// call reserves all that later ones can need.
    pub fn process(&mut self, scan: MessageRef<RadarScan>, points: &mut Message<RadarPoints>) {
        let missing = RadarPoints::MAX_ITEMS.saturating_sub(points.items.len());
        points.items.reserve_exact(missing);
        points.items.clear();
        let filtered = self.filter(scan);
        points.items.resize(filtered.len, Return::default());
        filtered.write_head(&mut points.head);
        filtered.write_items(&mut points.items);
    }

    /// The returns of a cluster that are above the threshold.
    fn kept<'a>(
        &self,
        returns: &'a [Return],
        cluster: &Range<usize>,
    ) -> impl Iterator<Item = &'a Return> + use<'a> {
        let intensity_min = self.intensity_min;
        let cluster = returns.get(cluster.clone()).unwrap_or_default();
        cluster.iter().filter(move |r| r.intensity > intensity_min)
    }

    /// The strongest return of a beam with its flanks; empty where none is between the limits.
    fn cluster(&self, beam: &[Return]) -> Range<usize> {
        let Some((peak, strongest)) = self.strongest(beam) else {
            return 0..0;
        };
        // Counts the neighbours that follow on one side; `sign` makes the step positive outwards
        // from the peak.
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
        peak - inwards..peak + outwards + 1
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
mod tests;

//! What is the same in every turn of a radar, found from its first sweeps.

use super::polar::{Cluster, Polar, clusters};
use crate::{Options, Rotation, StampMeaning, counters::Counters};
use randt_geometry::elementary::{PI, atan2, sin_cos, wrap};
use randt_messages::{MAX_BEAMS, SensorKind};
use std::ops::RangeInclusive;

/// Turn of a radar of which nothing is known, s: the iSDR-C's.
const PERIOD_FALLBACK_S: f64 = 0.2;
/// Shortest and longest plausible turn, s.
const PERIODS_S: RangeInclusive<f64> = 0.005..=60.0;
/// Mean resultant length from which azimuths (or ranges) lie on a grid: 1 exactly on it, about 0
/// at random. 0.8 allows a jitter of a tenth of a step.
const ON_GRID: f64 = 0.8;
/// Share of steps in one direction from which beams count as ordered.
const ORDERED: f64 = 0.9;
/// A difference in range below this is rounding, not a step between bins, m.
const RANGE_STEP_MIN_M: f64 = 1e-3;

/// Beams of a Navtech's turn.
const NAVTECH_BEAMS: u32 = 400;

/// Angle between beams at equal angles.
fn step_rad(count: u32) -> f64 {
    2.0 * PI / f64::from(count)
}

/// Ranges at equal distances: range = offset + bin x resolution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bins {
    /// 0 where ranges lie on no grid.
    pub resolution_m: f64,
    pub offset_m: f64,
}

/// Constants of a radar's turn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turn {
    pub period_ns: i64,
    pub stamp: StampMeaning,
    /// Whether azimuth falls with time.
    pub clockwise: bool,
    /// Azimuth of the first beam; `None` where sweeps begin anywhere.
    pub start_azimuth_rad: Option<f64>,
    /// Beams of a full turn, where they lie on a grid of equal angles.
    pub grid: Option<u32>,
    /// Typical angle between beams where there is no grid; 0 where unknown.
    pub step_rad: f64,
    pub bins: Bins,
    /// Whether the clouds are known to be of Navtech's driver.
    pub is_navtech: bool,
}

impl Turn {
    /// Learns from the first sweeps; what had to be assumed is counted.
    pub fn learn(sweeps: &[Polar], options: &Options, counters: &mut Counters) -> Self {
        let mut found: Vec<Vec<Cluster>> = sweeps.iter().map(|s| clusters(&s.points)).collect();
        let ordered = direction(&found);
        let sorted: Vec<Polar>;
        let mut sweeps = sweeps;
        if ordered.is_none() {
            sorted = sweeps.iter().map(sorted_copy).collect();
            sweeps = &sorted;
            found = sweeps.iter().map(|s| clusters(&s.points)).collect();
        }
        let clusters = found;
        let typical_rad = typical_step(&clusters);
        let grid = grid(&clusters, typical_rad);
        let clockwise = match (options.rotation, ordered) {
            (Rotation::Clockwise, _) => true,
            (Rotation::CounterClockwise, _) => false,
            (Rotation::Auto, Some(clockwise)) => clockwise,
            (Rotation::Auto, None) => {
                counters.count_event("rotation_assumed", 1, || {
                    "the points are in no order of azimuth: counter-clockwise from -pi assumed (--rotation)".to_owned()
                });
                false
            }
        };
        let start_azimuth_rad = match ordered {
            Some(ordered) if ordered == clockwise => start(&clusters, clockwise, grid),
            _ => Some(-PI),
        };
        Self {
            period_ns: period_ns(sweeps, options, counters),
            stamp: options.stamp,
            clockwise,
            start_azimuth_rad,
            grid,
            step_rad: grid.map_or(typical_rad, step_rad),
            bins: bins(sweeps, &clusters),
            is_navtech: false,
        }
    }

    /// The sensor that turns like this.
    pub fn sensor(&self) -> SensorKind {
        // indurad iSDR-C: steps of 1.64 degrees, bins of 16.1 mm; no other radar has both.
        let near = |value: f64, wanted: f64| (value / wanted - 1.0).abs() < 0.05;
        if near(self.step_rad, 1.64 * PI / 180.0) && near(self.bins.resolution_m, 0.0161) {
            SensorKind::IsdrC
        } else if self.is_navtech && near(self.step_rad, step_rad(NAVTECH_BEAMS)) {
            SensorKind::NavtechCts
        } else {
            SensorKind::Unknown
        }
    }
}

/// The same points by azimuth, then by range.
fn sorted_copy(sweep: &Polar) -> Polar {
    let mut sweep = sweep.clone();
    let points = &mut sweep.points;
    points.sort_by(|a, b| a.azimuth_rad.total_cmp(&b.azimuth_rad));
    for cluster in clusters(&sweep.points) {
        if let Some(beam) = sweep.points.get_mut(cluster.points) {
            beam.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        }
    }
    sweep
}

/// The value at `fraction` of a sorted list.
fn quantile(sorted: &[f64], fraction: f64) -> Option<f64> {
    let index = (sorted.len() as f64 * fraction) as usize;
    sorted.get(index).copied()
}

/// Signed angles between one cluster and the next, of all sweeps.
fn steps(clusters: &[Vec<Cluster>]) -> impl Iterator<Item = f64> + '_ {
    let pairs = clusters.iter().flat_map(|sweep| sweep.windows(2));
    pairs.filter_map(|pair| match pair {
        [a, b] => Some(wrap(b.azimuth_rad - a.azimuth_rad)),
        _ => None,
    })
}

/// A low quantile of the angles between clusters: beams without a return make some of them larger.
fn typical_step(clusters: &[Vec<Cluster>]) -> f64 {
    let mut angles: Vec<f64> = steps(clusters).map(f64::abs).collect();
    angles.sort_by(f64::total_cmp);
    quantile(&angles, 0.1).unwrap_or(0.0)
}

/// The number of beams a turn on whose grid the clusters lie best, if they lie on one.
fn grid(clusters: &[Vec<Cluster>], step_rad: f64) -> Option<u32> {
    if step_rad <= 0.0 {
        return None;
    }
    let guess = 2.0 * PI / step_rad;
    let candidates = (0.9 * guess) as u32..=((1.1 * guess) as u32).min(MAX_BEAMS as u32);
    let mut best: Option<(f64, u32)> = None;
    for count in candidates.filter(|count| *count >= 2) {
        let (mut sum, mut weight) = (0.0, 0.0);
        for sweep in clusters {
            let angles = sweep.iter().map(|c| f64::from(count) * c.azimuth_rad);
            sum += resultant(angles).0 * sweep.len() as f64;
            weight += sweep.len() as f64;
        }
        let score = sum / weight;
        if best.is_none_or(|(known, _)| score > known) {
            best = Some((score, count));
        }
    }
    let best = best.filter(|(score, _)| *score > ON_GRID);
    best.map(|(_, count)| count)
}

/// Length (0..1) and direction of the mean of unit vectors.
pub(super) fn resultant(angles: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut x, mut y, mut count) = (0.0, 0.0, 0.0);
    for angle in angles {
        let (sin, cos) = sin_cos(angle);
        (x, y, count) = (x + cos, y + sin, count + 1.0);
    }
    if count > 0.0 {
        ((x * x + y * y).sqrt() / count, atan2(y, x))
    } else {
        (0.0, 0.0)
    }
}

/// Whether azimuth falls along the points; `None` where they are in no order.
fn direction(clusters: &[Vec<Cluster>]) -> Option<bool> {
    let (mut rising, mut all) = (0.0, 0.0);
    for step in steps(clusters) {
        rising += f64::from(u8::from(step > 0.0));
        all += 1.0;
    }
    match rising {
        _ if all == 0.0 => None,
        rising if rising >= ORDERED * all => Some(false),
        rising if rising <= (1.0 - ORDERED) * all => Some(true),
        _ => None,
    }
}

/// Angle from `a` to `b` in the sense of rotation, in [0, 2 pi).
pub(super) fn ahead(a_rad: f64, b_rad: f64, clockwise: bool) -> f64 {
    let angle = match clockwise {
        true => wrap(a_rad - b_rad),
        false => wrap(b_rad - a_rad),
    };
    if angle < 0.0 { angle + 2.0 * PI } else { angle }
}

/// Azimuth of the first beam. It lies behind the last beam of every sweep and not behind the
/// first: beams without a return leave several starts, of which a seam of atan2 (-pi) is the
/// likeliest.
fn start(clusters: &[Vec<Cluster>], clockwise: bool, grid: Option<u32>) -> Option<f64> {
    let sense = if clockwise { -1.0 } else { 1.0 };
    let mut ends = clusters
        .iter()
        .filter(|sweep| direction(core::slice::from_ref(*sweep)) == Some(clockwise))
        .filter_map(|sweep| Some((sweep.first()?.azimuth_rad, sweep.last()?.azimuth_rad)))
        .filter(|(first, last)| first != last);
    let (reference, last) = ends.next()?;
    // Everything relative to the first sweep's first beam, in the sense of rotation.
    let (mut latest, mut earliest) = (0.0_f64, -ahead(last, reference, clockwise));
    for (first, last) in ends {
        let begin = sense * wrap(first - reference);
        latest = latest.min(begin);
        earliest = earliest.max(begin - ahead(last, first, clockwise));
    }
    let step = grid.map_or(0.0, step_rad);
    if earliest > latest - 0.5 * step {
        return None;
    }
    let seam = -ahead(-PI, reference, clockwise);
    let starts = match step > 0.0 {
        true => ((latest - earliest) / step).round() as i32,
        false => 0,
    };
    let mut starts = (0..starts).map(|back| latest - f64::from(back) * step);
    let at_seam = starts.find(|start_at| wrap(start_at - seam).abs() < 0.5 * step);
    Some(wrap(reference + sense * at_seam.unwrap_or(latest)))
}

/// Median spacing of the stamps, unless the options have it.
fn period_ns(sweeps: &[Polar], options: &Options, counters: &mut Counters) -> i64 {
    let spacings = sweeps.windows(2).filter_map(|pair| match pair {
        [a, b] => Some(b.stamp_ns.checked_sub(a.stamp_ns)? as f64 * 1e-9),
        _ => None,
    });
    let is_plausible = |period_s: &f64| PERIODS_S.contains(period_s);
    let mut spacings: Vec<f64> = spacings.filter(is_plausible).collect();
    spacings.sort_by(f64::total_cmp);
    let given = options.period_s.filter(is_plausible);
    let period_s = given.or_else(|| quantile(&spacings, 0.5)).unwrap_or_else(|| {
        counters.count_event("period_assumed", 1, || {
            format!("too few stamps to measure the time of a turn: {PERIOD_FALLBACK_S} s assumed (--period)")
        });
        PERIOD_FALLBACK_S
    });
    (period_s * 1e9).round() as i64
}

/// The grid of ranges, if there is one.
fn bins(sweeps: &[Polar], clusters: &[Vec<Cluster>]) -> Bins {
    let mut ranges: Vec<&[_]> = Vec::new();
    for (sweep, clusters) in sweeps.iter().zip(clusters) {
        let clusters = clusters.iter();
        ranges.extend(clusters.filter_map(|c| sweep.points.get(c.points.clone())));
    }
    let mut steps: Vec<f64> = Vec::new();
    for beam in &ranges {
        steps.extend(beam.windows(2).filter_map(|pair| match pair {
            [a, b] => Some((b.range_m - a.range_m).abs()).filter(|d| *d > RANGE_STEP_MIN_M),
            _ => None,
        }));
    }
    steps.sort_by(f64::total_cmp);
    let Some(mut resolution_m) = quantile(&steps, 0.1) else {
        return Bins::default();
    };
    // Least squares over short steps, then over long ones, whose bin numbers the short ones made
    // sure.
    for longest in [4.0, 16.0, 64.0, 256.0] {
        let (mut product, mut square) = (0.0, 0.0);
        for step in &steps {
            let bins = (step / resolution_m).round();
            if bins <= longest {
                product += bins * step;
                square += bins * bins;
            }
        }
        if square > 0.0 {
            resolution_m = product / square;
        }
    }
    let turn = 2.0 * PI / resolution_m;
    let all = ranges.iter().flat_map(|beam| beam.iter());
    let (length, phase) = resultant(all.map(|point| turn * point.range_m));
    if length < ON_GRID {
        return Bins::default();
    }
    // A quarter of a bin to either side of 0 and of a half stays on its side whatever the
    // rounding.
    let offset = phase / (2.0 * PI);
    let offset = if offset < -0.25 { offset + 1.0 } else { offset };
    Bins {
        resolution_m,
        offset_m: offset * resolution_m,
    }
}

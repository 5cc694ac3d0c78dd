//! The time offset: how late the radar's stamps are against the gyro's.
//!
//! Within a stretch the radar's yaw is the gyro's integrated rate d earlier, up to a constant, the gyro's bias and its
//! scale. What is left over grows with the offset's error times the yaw rate: each stretch gives an offset by least
//! squares, with a bias of its own and a scale that all share. Odometry's yaw wanders slowly under a scan's noise;
//! both are made white before (the innovations of a local level), so that quick changes of the turn count most.

use crate::estimate::{Estimate, Part, mean};
use crate::motion::{Step, cut, turned_rad};
use crate::{Gyro, RadarPose, Span, Unshown};
use randt_geometry::elementary::wrap;

/// Length of a stretch, s: long against the change of a turn, and there are many of them in a drive.
const STRETCH_S: f64 = 8.0;
/// How much of a scan's surprise is odometry's yaw that wanders: 1 mrad a scan under 3 mrad of noise, as simulated
/// drives have it.
const LEVEL_GAIN: f64 = 0.28;
/// Standard deviation of the yaw rate in a stretch that shows the offset, rad/s: 30 ms of it are 3 mrad, what one
/// scan's yaw is good for.
const RATE_MIN_RAD_S: f64 = 0.1;
/// Stretches that are needed.
const STRETCHES_MIN: usize = 5;
/// Largest offset that is looked for: a device that buffers longer is broken.
const LIMIT_NS: i64 = 500_000_000;
/// Steps of the search: a fraction of the time in which a robot's turn changes.
const SEARCH_NS: i64 = 20_000_000;
/// Share of the radar's turning that the gyro must explain.
const EXPLAINED_MIN: f64 = 0.8;
/// What repeats itself in every stretch: stamps' own errors, and the motion model that pulls odometry's yaw, s.
const SYSTEMATIC_S: f64 = 0.0003;
const ROUNDS: u32 = 30;
/// A change of the offset that ends them, ns.
const SETTLED_NS: i64 = 1000;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOffset {
    /// The radar's stamps are so much late against the gyro's, s: what the radar stamps t happened at t - late by the
    /// gyro's clock.
    pub late_s: Estimate,
    /// What showed it.
    pub spans: Vec<Span>,
    /// Angle turned in them, either way, rad.
    pub turned_rad: f64,
    /// Root mean square of what is left between radar and gyro from scan to scan, rad.
    pub residual_rad: f64,
    /// How much more the radar turned than the gyro, as a share.
    pub scale: f64,
}

/// Sums over a stretch's rows at one offset: yaw rate r, gyro's turn s, what is left over e.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    rr: f64,
    rs: f64,
    ss: f64,
    re: f64,
    se: f64,
    ee: f64,
    rows: usize,
}

/// Estimates it.
pub fn time_offset(poses: &[RadarPose], gyro: &Gyro) -> Result<TimeOffset, Unshown> {
    let stretches = stretches(poses, gyro);
    let turning: Vec<&[RadarPose]> = stretches.into_iter().filter(|s| turns(s)).collect();
    if turning.len() < STRETCHES_MIN {
        return Err(Unshown::Turning {
            turning: turning.len(),
            needed: STRETCHES_MIN,
            stretch_s: STRETCH_S,
            rate_rad_s: RATE_MIN_RAD_S,
        });
    }
    let fits = |late_ns: i64| -> Vec<Fit> {
        turning
            .iter()
            .filter_map(|stretch| fit(stretch, gyro, late_ns))
            .collect()
    };
    let left_over = |late_ns: &i64| Fit::sum(&fits(*late_ns)).ee;
    let tries = (-LIMIT_NS..=LIMIT_NS).step_by(SEARCH_NS as usize);
    let best = tries.min_by(|a, b| left_over(a).total_cmp(&left_over(b)));
    let mut late_ns = best.unwrap_or_default();
    let mut late_s = Estimate {
        value: 0.0,
        sigma: 0.0,
    };
    let mut sum = Fit::default();
    for _ in 0..ROUNDS {
        let fits = fits(late_ns);
        sum = Fit::sum(&fits);
        let scale = sum.scale();
        let parts: Vec<Part> = fits.iter().map(|fit| fit.part(late_ns, scale)).collect();
        let Some(found) = mean(&parts) else { break };
        late_s = found;
        let next_ns = ((found.value * 1e9) as i64).clamp(-LIMIT_NS, LIMIT_NS);
        let moved_ns = (next_ns - late_ns).abs();
        late_ns = next_ns;
        if moved_ns < SETTLED_NS {
            break;
        }
    }
    let explained = 1.0 - sum.ee / sum.ss.max(f64::MIN_POSITIVE);
    if explained < EXPLAINED_MIN || late_ns.abs() == LIMIT_NS {
        return Err(Unshown::Unlike {
            limit_ms: LIMIT_NS as f64 * 1e-6,
            offset_ms: late_ns as f64 * 1e-6,
            share: 100.0 * explained.max(0.0),
        });
    }
    let spans = turning.iter().filter_map(|s| Span::of(s)).collect();
    let turned = |stretch: &&[RadarPose]| -> f64 {
        let next = stretch.iter().skip(1);
        stretch
            .iter()
            .zip(next)
            .map(|(a, b)| turned_rad(a, b))
            .sum()
    };
    Ok(TimeOffset {
        late_s: late_s.with_systematic(SYSTEMATIC_S),
        spans: Span::joined(spans),
        turned_rad: turning.iter().map(turned).sum(),
        residual_rad: (sum.ee / sum.rows.max(1) as f64).sqrt(),
        scale: sum.scale(),
    })
}

/// Stretches of the radar's path that the gyro covers whatever the offset.
fn stretches<'a>(poses: &'a [RadarPose], gyro: &Gyro) -> Vec<&'a [RadarPose]> {
    let mut stretches = Vec::new();
    let follows = |a: &RadarPose, b: &RadarPose| Step::between(a, b).is_some();
    for run in poses.chunk_by(follows) {
        let seconds = |a: &RadarPose, b: &RadarPose| (b.stamp_ns - a.stamp_ns) as f64 * 1e-9;
        stretches.extend(cut(run, seconds, STRETCH_S));
    }
    stretches.retain(|stretch| {
        Span::of(stretch)
            .is_some_and(|span| gyro.covers(span.begin_ns - LIMIT_NS, span.end_ns + LIMIT_NS))
    });
    stretches
}

/// Whether the yaw rate changes enough. The radar is asked, because the gyro's instant is not known yet.
fn turns(stretch: &[RadarPose]) -> bool {
    let steps = stretch.windows(2).filter_map(|pair| match pair {
        [a, b] => Step::between(a, b),
        _ => None,
    });
    let rates: Vec<f64> = steps.map(|step| step.rate_rad_s).collect();
    let count = rates.len().max(1) as f64;
    let mean = rates.iter().sum::<f64>() / count;
    let spread = rates
        .iter()
        .map(|rate| (rate - mean) * (rate - mean))
        .sum::<f64>()
        / count;
    spread > RATE_MIN_RAD_S * RATE_MIN_RAD_S
}

fn fit(stretch: &[RadarPose], gyro: &Gyro, late_ns: i64) -> Option<Fit> {
    let first = stretch.first()?;
    let (_, mut level) = row(first, first, gyro, late_ns)?;
    let mut white = [0.0; 4];
    let mut rows: Vec<[f64; 4]> = Vec::with_capacity(stretch.len());
    let mut before = first;
    for pose in stretch.get(1..)? {
        let (step, next) = row(before, pose, gyro, late_ns)?;
        let change = [step[0], step[1], next[1] - level[1], next[0] - level[0]];
        for (white, change) in white.iter_mut().zip(change) {
            *white = change + (1.0 - LEVEL_GAIN) * *white;
        }
        rows.push(white);
        (level, before) = (next, pose);
    }
    // The gyro's bias: taken out of the other columns.
    let time2: f64 = rows.iter().map(|[time, ..]| time * time).sum();
    let mut fit = Fit {
        rows: rows.len(),
        ..Fit::default()
    };
    let slope = |column: fn(&[f64; 4]) -> f64| {
        rows.iter().map(|row| row[0] * column(row)).sum::<f64>() / time2.max(f64::MIN_POSITIVE)
    };
    let slopes = [
        slope(|row| row[1]),
        slope(|row| row[2]),
        slope(|row| row[3]),
    ];
    for [time, yaw, rate, angle] in rows {
        let s = angle - slopes[2] * time;
        let r = rate - slopes[1] * time;
        let e = yaw - slopes[0] * time - s;
        fit.rr += r * r;
        fit.rs += r * s;
        fit.ss += s * s;
        fit.re += r * e;
        fit.se += s * e;
        fit.ee += e * e;
    }
    Some(fit)
}

/// From one pose to another: seconds and the radar's turn; and the gyro's angle and rate at the latter.
fn row(
    before: &RadarPose,
    pose: &RadarPose,
    gyro: &Gyro,
    late_ns: i64,
) -> Option<([f64; 2], [f64; 2])> {
    let (angle_rad, rate_rad_s) = gyro.at(pose.stamp_ns - late_ns)?;
    let time_s = (pose.stamp_ns - before.stamp_ns) as f64 * 1e-9;
    let yaw_rad = wrap(pose.pose.yaw_rad - before.pose.yaw_rad);
    Some(([time_s, yaw_rad], [angle_rad, rate_rad_s]))
}

impl Fit {
    fn sum(fits: &[Self]) -> Self {
        let mut sum = Self::default();
        for fit in fits {
            sum.rr += fit.rr;
            sum.rs += fit.rs;
            sum.ss += fit.ss;
            sum.re += fit.re;
            sum.se += fit.se;
            sum.ee += fit.ee;
            sum.rows += fit.rows;
        }
        sum
    }

    /// The gyro's scale error, the offset left free.
    fn scale(&self) -> f64 {
        let determinant = self.rr * self.ss - self.rs * self.rs;
        if determinant <= 1e-6 * self.rr * self.ss {
            return 0.0;
        }
        (self.rr * self.se - self.rs * self.re) / determinant
    }

    /// The offset that this stretch would have: what is left over is the scale's share, less the rate times the
    /// offset's change.
    fn part(&self, late_ns: i64, scale: f64) -> Part {
        let change_s = (scale * self.rs - self.re) / self.rr.max(f64::MIN_POSITIVE);
        Part {
            value: late_ns as f64 * 1e-9 + change_s,
            weight: self.rr,
        }
    }
}

//! A stretch of the drive: what is left between radar and gyro at one offset, made white.

use crate::estimate::PartialEstimate;
use crate::motion::{Step, cut};
use crate::{Gyro, RadarPose, Span};
use randt_geometry::elementary::wrap;

/// Length of a stretch, s: long against the change of a turn, and there are many of them in a
/// drive.
pub const STRETCH_S: f64 = 8.0;
/// How much of a scan's surprise is odometry's yaw that wanders: 1 mrad a scan under 3 mrad of
/// noise, as simulated drives have it.
const LEVEL_GAIN: f64 = 0.28;
/// Standard deviation of the yaw rate in a stretch that shows the offset, rad/s: 30 ms of it are 3
/// mrad, what one scan's yaw is good for.
pub const RATE_MIN_RAD_S: f64 = 0.1;

/// Sums over a stretch's rows at one offset: yaw rate r, gyro's turn s, what is left over e.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fit {
    pub rr: f64,
    pub rs: f64,
    pub ss: f64,
    pub re: f64,
    pub se: f64,
    pub ee: f64,
    pub rows: usize,
}

/// Stretches of the radar's path that the gyro covers whatever the offset.
pub fn stretches<'a>(poses: &'a [RadarPose], gyro: &Gyro, limit_ns: i64) -> Vec<&'a [RadarPose]> {
    let mut stretches = Vec::new();
    let follows = |a: &RadarPose, b: &RadarPose| Step::between(a, b).is_some();
    for run in poses.chunk_by(follows) {
        let seconds = |a: &RadarPose, b: &RadarPose| (b.stamp_ns - a.stamp_ns) as f64 * 1e-9;
        stretches.extend(cut(run, seconds, STRETCH_S));
    }
    stretches.retain(|stretch| {
        Span::from_poses(stretch)
            .is_some_and(|span| gyro.covers(span.begin_ns - limit_ns, span.end_ns + limit_ns))
    });
    stretches
}

/// Whether the yaw rate changes enough. The radar is asked, because the gyro's instant is not
/// known yet.
pub fn turns(stretch: &[RadarPose]) -> bool {
    let steps = stretch.windows(2).filter_map(|pair| match pair {
        [a, b] => Step::between(a, b),
        _ => None,
    });
    let rates: Vec<f64> = steps.map(|step| step.rate_rad_s).collect();
    let count = rates.len().max(1) as f64;
    let mean = rates.iter().sum::<f64>() / count;
    let squares = rates.iter().map(|rate| (rate - mean) * (rate - mean));
    let spread = squares.sum::<f64>() / count;
    spread > RATE_MIN_RAD_S * RATE_MIN_RAD_S
}

/// Sums up a stretch at one offset; `None` where the gyro does not cover it.
pub fn fit(stretch: &[RadarPose], gyro: &Gyro, late_ns: i64) -> Option<Fit> {
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

/// From one pose to another: seconds and the radar's turn; and the gyro's angle and rate at the
/// latter.
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
    pub fn sum(fits: &[Self]) -> Self {
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
    pub fn scale(&self) -> f64 {
        let determinant = self.rr * self.ss - self.rs * self.rs;
        if determinant <= 1e-6 * self.rr * self.ss {
            return 0.0;
        }
        (self.rr * self.se - self.rs * self.re) / determinant
    }

    /// The offset that this stretch would have: what is left over is the scale's share, less the
    /// rate times the offset's change.
    pub fn part(&self, late_ns: i64, scale: f64) -> PartialEstimate {
        let change_s = (scale * self.rs - self.re) / self.rr.max(f64::MIN_POSITIVE);
        PartialEstimate {
            value: late_ns as f64 * 1e-9 + change_s,
            weight: self.rr,
        }
    }
}

//! The time offset: how late the radar's stamps are against the gyro's.
//!
//! Within a stretch the radar's yaw is the gyro's integrated rate d earlier, up to a constant, the
//! gyro's bias and its scale. What is left over grows with the offset's error times the yaw rate:
//! each stretch gives an offset by least squares, with a bias of its own and a scale that all
//! share. Odometry's yaw wanders slowly under a scan's noise; both are made white before (the
//! innovations of a local level), so that quick changes of the turn count most.

use crate::estimate::{Estimate, PartialEstimate, mean, median};
use crate::motion::turned_rad;
use crate::stretch::{Fit, RATE_MIN_RAD_S, STRETCH_S, fit, stretches, turns};
use crate::{Gyro, RadarPose, Span, Unobservable};

/// Stretches that are needed.
const STRETCHES_MIN: usize = 5;
/// Largest offset that is searched: a device that buffers longer is broken.
const LIMIT_NS: i64 = 500_000_000;
/// Steps of the search: a fraction of the time in which a robot's turn changes.
const SEARCH_NS: i64 = 20_000_000;
/// Share of the radar's turning that the gyro must explain.
const EXPLAINED_MIN: f64 = 0.8;
/// What repeats itself in every stretch, s: stamps' own errors, and the motion model that pulls
/// odometry's yaw.
const SYSTEMATIC_S: f64 = 0.0005;
/// A stretch with this many times the usual residual (of squares) is one in which odometry
/// slipped.
const SLIPPED: f64 = 16.0;
const ROUNDS: u32 = 30;
/// A change of the offset that ends them, ns.
const CONVERGED_NS: i64 = 1000;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOffset {
    /// By this much the radar's stamps are late against the gyro's, s: what the radar stamps t
    /// happened at t - late by the gyro's clock.
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

/// Estimates it.
pub fn time_offset(poses: &[RadarPose], gyro: &Gyro) -> Result<TimeOffset, Unobservable> {
    let turning: Vec<&[RadarPose]> = stretches(poses, gyro, LIMIT_NS)
        .into_iter()
        .filter(|stretch| turns(stretch))
        .collect();
    if turning.len() < STRETCHES_MIN {
        return Err(Unobservable::Turning {
            turning: turning.len(),
            needed: STRETCHES_MIN,
            stretch_s: STRETCH_S,
            rate_rad_s: RATE_MIN_RAD_S,
        });
    }
    let fits = |late_ns: i64| -> Vec<Fit> {
        let fit = |stretch: &&[RadarPose]| fit(stretch, gyro, late_ns);
        turning.iter().filter_map(fit).collect()
    };
    // Roots, so that one stretch in which odometry slipped does not outvote the others.
    let left_over = |late_ns: &i64| fits(*late_ns).iter().map(|fit| fit.ee.sqrt()).sum::<f64>();
    let tries = (-LIMIT_NS..=LIMIT_NS).step_by(SEARCH_NS as usize);
    let best = tries.min_by(|a, b| left_over(a).total_cmp(&left_over(b)));
    let mut late_ns = best.unwrap_or_default();
    let mut late_s = Estimate {
        value: 0.0,
        sigma: 0.0,
    };
    let (mut good, mut sum, mut explained) = (Vec::new(), Fit::default(), 0.0);
    for _ in 0..ROUNDS {
        let fits = fits(late_ns);
        let mut sizes: Vec<f64> = fits.iter().map(|fit| fit.ee).collect();
        let mut shares: Vec<f64> = fits.iter().map(|fit| fit.ee / fit.ss).collect();
        let usual = median(&mut sizes).unwrap_or_default();
        explained = 1.0 - median(&mut shares).unwrap_or(1.0);
        let is_good = |fit: &Fit| fit.ee < SLIPPED * usual;
        good = fits.iter().map(is_good).collect();
        let fits: Vec<Fit> = fits.into_iter().filter(is_good).collect();
        sum = Fit::sum(&fits);
        let scale = sum.scale();
        let parts: Vec<PartialEstimate> = fits.iter().map(|fit| fit.part(late_ns, scale)).collect();
        let Some(found) = mean(&parts) else { break };
        late_s = found;
        let next_ns = ((found.value * 1e9) as i64).clamp(-LIMIT_NS, LIMIT_NS);
        let moved_ns = (next_ns - late_ns).abs();
        late_ns = next_ns;
        if moved_ns < CONVERGED_NS {
            break;
        }
    }
    if explained < EXPLAINED_MIN || late_ns.abs() == LIMIT_NS {
        return Err(Unobservable::Unlike {
            limit_ms: LIMIT_NS as f64 * 1e-6,
            offset_ms: late_ns as f64 * 1e-6,
            share: 100.0 * explained.max(0.0),
        });
    }
    let used = turning.iter().zip(&good).filter(|(_, good)| **good);
    let used: Vec<&[RadarPose]> = used.map(|(stretch, _)| *stretch).collect();
    let spans = used.iter().filter_map(|stretch| Span::from_poses(stretch));
    let turned = |stretch: &&[RadarPose]| -> f64 {
        let pairs = stretch.iter().zip(stretch.iter().skip(1));
        pairs.map(|(a, b)| turned_rad(a, b)).sum()
    };
    Ok(TimeOffset {
        late_s: late_s.with_systematic(SYSTEMATIC_S),
        spans: Span::joined(spans.collect()),
        turned_rad: used.iter().map(turned).sum(),
        residual_rad: (sum.ee / sum.rows.max(1) as f64).sqrt(),
        scale: sum.scale(),
    })
}

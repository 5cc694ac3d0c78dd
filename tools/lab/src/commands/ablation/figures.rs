//! The figures of one variant in one world, over all its drives.

use randt::judgement::Judgement;
use randt::report::Cost;
use randt_evaluation::{LoopEvaluation, Worst};
use serde::Serialize;

/// What one drive gave.
pub(super) struct Trial {
    /// Against the truth.
    pub judgement: Judgement,
    /// Filter and motion estimation of each scan, ns.
    pub scan_ns: Vec<u64>,
}

/// Over all drives; null where a figure is not defined.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    /// Median over the drives.
    pub ate_rmse_m: Option<f64>,
    /// Largest relative errors over a second.
    pub worst_1s_translation_m: Option<f64>,
    /// The same of rotation.
    pub worst_1s_rotation_deg: Option<f64>,
    /// Drives that lost track.
    pub lost_track: usize,
    /// Accepted loops, all drives together.
    pub loops: usize,
    /// Of those, false ones.
    pub false_loops: usize,
    /// Share of all drives' revisits that were recognised.
    pub recall: Option<f64>,
    /// Time per scan: filter and motion estimation.
    pub median_ms: f64,
    /// 99th percentile of the same.
    pub p99_ms: f64,
}

impl Figures {
    pub(super) fn from_trials(trials: &[Trial]) -> Self {
        let worst = |figure: fn(&Worst) -> f64| {
            let seconds = trials.iter().filter_map(|t| t.judgement.track.second);
            seconds.map(|worst| figure(&worst)).max_by(f64::total_cmp)
        };
        let loops = |count: fn(&LoopEvaluation) -> usize| -> usize {
            let loops = trials.iter().filter_map(|t| t.judgement.loops.as_ref());
            loops.map(count).sum()
        };
        let revisits = loops(|l| l.revisits);
        let scan_ns: Vec<u64> = trials
            .iter()
            .flat_map(|t| t.scan_ns.iter().copied())
            .collect();
        let cost = Cost::from_times(&scan_ns);
        Self {
            ate_rmse_m: median(
                trials
                    .iter()
                    .filter_map(|t| t.judgement.evaluation.ate_rmse_m)
                    .collect(),
            ),
            worst_1s_translation_m: worst(|w| w.translation),
            worst_1s_rotation_deg: worst(|w| w.rotation_deg),
            lost_track: trials.iter().filter(|t| t.judgement.track.lost).count(),
            loops: loops(|l| l.loops),
            false_loops: loops(|l| l.false_loops.len()),
            recall: (revisits > 0).then(|| loops(|l| l.recalled) as f64 / revisits as f64),
            median_ms: cost.median_ms,
            p99_ms: cost.p99_ms,
        }
    }
}

/// The middle value; of an even number the mean of both middle ones.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    let lower = values.get((values.len() - 1) / 2)?;
    Some(0.5 * (lower + upper))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_median_of_an_even_number_lies_between_both_middle_ones() {
        assert_eq!(super::median(vec![]), None);
        assert_eq!(super::median(vec![3.0]), Some(3.0));
        assert_eq!(super::median(vec![4.0, 1.0, 3.0]), Some(3.0));
        assert_eq!(super::median(vec![4.0, 1.0, 3.0, 2.0]), Some(2.5));
    }
}

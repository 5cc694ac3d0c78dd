//! The search for loop candidates: by what a keyframe looks like and by where the estimate has it.

use super::{CandidateOrigin, LoopCandidate, PlaceRecognition, ScanContext};
use crate::index::KeyframeIdx;
use crate::keyframe::MapKeyframe;
use randt_geometry::elementary::exp;

/// Candidates of each origin; each costs a registration.
const CANDIDATES_MAX: usize = 3;

impl PlaceRecognition {
    fn context(&self, index: usize, keyframes: &[MapKeyframe]) -> Option<&ScanContext> {
        let (context, keyframe) = (self.contexts.get(index)?, keyframes.get(index)?);
        let made = || ScanContext::new(&keyframe.observation.points, &self.config).0;
        Some(context.get_or_init(made))
    }

    /// Keyframes whose revisit is a loop: those of an earlier stretch of the path, or of another
    /// frame.
    fn old<'a>(
        &self,
        keyframes: &'a [MapKeyframe],
    ) -> impl Iterator<Item = (usize, &'a MapKeyframe)> + use<'a> {
        let path_min_m = self.config.path_min_m;
        let newest = keyframes.last();
        keyframes.iter().enumerate().filter(move |(_, keyframe)| {
            newest.is_some_and(|newest| {
                keyframe.odom_frame_id != newest.odom_frame_id
                    || newest.path_m - keyframe.path_m >= path_min_m
            })
        })
    }

    /// The keyframes that look most like the newest one, best first, one of each neighbourhood.
    ///
    /// `is_node(keyframe)`: whether it is a node of the graph, for only these make loops.
    /// `deviations(keyframe)`: how many standard deviations away from there the estimate has the
    /// robot, where it is known. It adds 1 - exp(-d^2 / 2) to the distance (odometry similarity,
    /// as in TBV SLAM).
    pub fn by_appearance(
        &self,
        keyframes: &[MapKeyframe],
        is_node: impl Fn(KeyframeIdx) -> bool,
        mut deviations: impl FnMut(KeyframeIdx) -> Option<f64>,
    ) -> Vec<LoopCandidate> {
        let newest = self.keys.len().saturating_sub(1);
        let (Some(key), Some(context)) = (self.keys.last(), self.context(newest, keyframes)) else {
            return Vec::new();
        };
        let distance = |(i, _)| Some((key.distance(self.keys.get(i)?), i));
        let old = self
            .old(keyframes)
            .filter(|(i, _)| is_node(KeyframeIdx(*i)));
        let mut sieve: Vec<(f32, usize)> = old.filter_map(distance).collect();
        let keep = self.config.candidates as usize;
        if sieve.len() > keep {
            sieve.select_nth_unstable_by(keep, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            sieve.truncate(keep);
        }
        let alike = sieve.iter().filter_map(|&(_, index)| {
            let keyframe = KeyframeIdx(index);
            let likeness = self.context(index, keyframes)?.compare(context);
            let odometry = deviations(keyframe).map_or(0.0, |d| 1.0 - exp(-0.5 * d * d));
            let distance = likeness.distance + odometry;
            let yaw_rad = likeness.yaw_rad;
            let origin = CandidateOrigin::Appearance { distance, yaw_rad };
            Some((distance, LoopCandidate { keyframe, origin }))
        });
        let best = self.apart(keyframes, alike.collect()).into_iter();
        best.take(CANDIDATES_MAX)
            .map(|(_, candidate)| candidate)
            .collect()
    }

    /// The old keyframes nearest to the newest one, within `radius_m`, one of each neighbourhood.
    /// `away_m(keyframe)`: how far away the estimate has a keyframe, where it is known.
    ///
    /// Where more laps lie within a keyframe distance than are tried, all of them are as near, and
    /// the oldest come first: later laps then hold to the first ones, and the graph stays as
    /// sparse as those.
    pub fn by_proximity(
        &self,
        keyframes: &[MapKeyframe],
        radius_m: f64,
        away_m: impl Fn(KeyframeIdx) -> Option<f64>,
    ) -> Vec<LoopCandidate> {
        let old = self.old(keyframes).filter_map(|(index, _)| {
            let keyframe = KeyframeIdx(index);
            let origin = CandidateOrigin::Proximity;
            Some((away_m(keyframe)?, LoopCandidate { keyframe, origin }))
        });
        let near = old.filter(|(away_m, _)| *away_m <= radius_m);
        let mut laps = self.apart(keyframes, near.collect());
        let here = laps.partition_point(|(away_m, _)| *away_m < self.step_m);
        if here > CANDIDATES_MAX {
            laps.truncate(here);
            laps.sort_by_key(|(_, candidate)| candidate.keyframe);
        }
        laps.truncate(CANDIDATES_MAX);
        laps.into_iter().map(|(_, candidate)| candidate).collect()
    }

    /// The best candidates, best first, no two of them of one neighbourhood of the path.
    fn apart(
        &self,
        keyframes: &[MapKeyframe],
        mut candidates: Vec<(f64, LoopCandidate)>,
    ) -> Vec<(f64, LoopCandidate)> {
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.keyframe.cmp(&b.1.keyframe)));
        let at = |candidate: &LoopCandidate| keyframes.get(candidate.keyframe.0);
        let near = |a: &LoopCandidate, b: &LoopCandidate| match (at(a), at(b)) {
            (Some(a), Some(b)) => {
                a.odom_frame_id == b.odom_frame_id && (a.path_m - b.path_m).abs() < self.apart_m
            }
            _ => true,
        };
        let mut best: Vec<(f64, LoopCandidate)> = Vec::new();
        for candidate in candidates {
            if !best.iter().any(|other| near(&other.1, &candidate.1)) {
                best.push(candidate);
            }
        }
        best
    }
}

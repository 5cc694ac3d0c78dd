//! Known ground: keyframes that show what others have shown are taken out of the graph.
//!
//! A place keeps the keyframes of its first laps. Later laps find their way by loops to these;
//! once they lie behind, their keyframes stand on the kept ones, so that the graph grows with the
//! ground and not with the way.
//!
//! What they saw goes with them, but for what is newest at its place: the grid shows that.
//!
//! Responsible for which keyframes go. Not responsible for what is left of their constraints
//! ([`crate::pose_graph::PoseGraph::marginalize`]): it is less than was measured, never more.

mod observations;

use crate::index::KeyframeIdx;
use crate::journal::AttachedPose;
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::pose_graph::KeyframeGraph;
use crate::verification::{LoopClosure, LoopStatus, LoopVerification, Submaps};
use observations::LeftObservations;
use randt_config::Config;
use randt_persist::persist;
use std::ops::Range;

/// Keyframes are judged this many keyframe distances of path behind the newest one: until then
/// loops lean on them (`verification/confirm.rs` looks back 40).
const BEHIND_KEYFRAMES: f64 = 50.0;
/// Loops of the graph that hold the drive where it comes to known ground, and where it goes on
/// after keyframes that are taken out: as many keep their keyframes.
const HOLDING_MIN: usize = 3;

/// Takes keyframes of known ground out of the graph, submap by submap, each judged once.
pub(crate) struct KnownGround {
    /// The oldest keyframe that is not judged.
    next: KeyframeIdx,
    /// Loops of the graph at kept keyframes since the ground was last unknown.
    holding: usize,
    /// Of keyframes that have left.
    observations: LeftObservations,
    /// The newest keyframe, where a compacted journal has it as one that has left.
    leaving: Option<(KeyframeIdx, AttachedPose)>,
    laps_max: usize,
    behind_m: f64,
    /// Keyframes within this distance of each other show one place, m.
    step_m: f64,
    /// Path after which a place is met again, m.
    lap_min_m: f64,
}
// What is held follows from the graph, who leaves from the journal.
persist!(KnownGround { next, holding } kept { observations, leaving, laps_max, behind_m, step_m, lap_min_m });

impl KnownGround {
    /// Nothing judged yet.
    pub fn new(config: &Config) -> Self {
        Self {
            next: KeyframeIdx(0),
            holding: 0,
            observations: LeftObservations::new(Submaps::new(config).reach_m()),
            leaving: None,
            laps_max: match config.loops.verify {
                true => config.loops.laps_max as usize,
                false => 0,
            },
            behind_m: BEHIND_KEYFRAMES * config.keyframe.distance_m,
            step_m: config.keyframe.distance_m,
            lap_min_m: config.loops.path_min_m,
        }
    }

    /// Judges the submaps that lie far enough behind the newest keyframe. Gives the keyframes that
    /// have left the graph and that nobody asks for any more, rising: what they saw is to be
    /// forgotten.
    pub fn thin(
        &mut self,
        keyframes: &KeyframeStore,
        verification: &mut LoopVerification,
        graph: &mut KeyframeGraph,
    ) -> Vec<KeyframeIdx> {
        let mut is_thinned = self.leave(keyframes, verification, graph);
        while self.laps_max > 0
            && let Some(stretch) = self.next_stretch(keyframes, verification)
        {
            self.next = KeyframeIdx(stretch.end);
            let stands_on = self.stands_on(&stretch, keyframes, graph);
            let loops = Loops::new(&stretch, &verification.closures, graph);
            let is_known = |to: &Vec<KeyframeIdx>| {
                loops.show_known_ground()
                    || loops.show_nothing() && self.is_located(&stretch, to, graph)
            };
            match stands_on.filter(is_known) {
                Some(stands_on) if self.holding >= HOLDING_MIN && loops.behind >= HOLDING_MIN => {
                    for (keyframe, to) in stretch.map(KeyframeIdx).zip(stands_on) {
                        if let Some(dropped) = graph.marginalize(keyframe, to) {
                            verification.drop_edges(&dropped);
                            self.observations.push(keyframe);
                            is_thinned = true;
                        }
                    }
                }
                Some(_) => self.holding += loops.edges,
                None => self.holding = 0,
            }
        }
        match is_thinned {
            true => self.observations.take_unneeded(keyframes, graph),
            false => Vec::new(),
        }
    }

    /// The newest keyframe is one that has left before: it leaves with the next one.
    pub fn is_leaving(&mut self, keyframe: KeyframeIdx, attached: AttachedPose) {
        self.leaving = Some((keyframe, attached));
    }

    /// The newest keyframe is one that has not.
    pub fn stays(&mut self) {
        self.leaving = None;
    }

    /// Lets it go, once there is one behind it; gives whether it went.
    fn leave(
        &mut self,
        keyframes: &KeyframeStore,
        verification: &mut LoopVerification,
        graph: &mut KeyframeGraph,
    ) -> bool {
        let Some((keyframe, attached)) = self.leaving.take() else {
            return false;
        };
        let to = keyframes.find(attached.to);
        let dropped = to.and_then(|to| graph.marginalize_forgotten(keyframe, to, attached.pose()));
        if let Some(dropped) = &dropped {
            verification.drop_edges(dropped);
            self.observations.push(keyframe);
        }
        dropped.is_some()
    }

    /// Finds out whose observations a map that comes back holds; gives the other keyframes that
    /// have left, as [`Self::thin`] does.
    pub fn recall(&mut self, keyframes: &[MapKeyframe], graph: &KeyframeGraph) -> Vec<KeyframeIdx> {
        let all = (0..keyframes.len()).map(KeyframeIdx);
        for keyframe in all.filter(|keyframe| !graph.is_unknown(*keyframe)) {
            self.observations.push(keyframe);
        }
        self.observations.take_unneeded(keyframes, graph)
    }

    /// Whether it is remembered what a keyframe that has left the graph saw.
    pub fn remembers(&self, keyframe: KeyframeIdx) -> bool {
        self.observations.holds(keyframe)
    }

    /// The next keyframes that are of one submap, once they and the way behind them are there.
    fn next_stretch(
        &self,
        keyframes: &KeyframeStore,
        verification: &LoopVerification,
    ) -> Option<Range<usize>> {
        let waiting = keyframes.get(self.next.0..)?;
        let submaps = &verification.submaps;
        let root_of = |keyframe: &MapKeyframe| submaps.root_of(keyframe, keyframes);
        let root = root_of(waiting.first()?);
        let is_same = |keyframe: &&MapKeyframe| root_of(keyframe) == root;
        let count = waiting.iter().take_while(is_same).count();
        let last = waiting.get(count.checked_sub(1)?)?;
        let is_behind = keyframes.path_m() - last.path_m >= self.behind_m;
        is_behind.then(|| self.next.0..self.next.0 + count)
    }

    /// For each keyframe of a stretch the kept one to stand on; `None` where one is of too few
    /// laps, or begins or ends a frame of odometry.
    fn stands_on(
        &self,
        stretch: &Range<usize>,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Option<Vec<KeyframeIdx>> {
        let around = stretch.start.checked_sub(1)?..stretch.end + 1;
        let frame = keyframes.get(stretch.start)?.odom_frame_id;
        let is_one_frame = |around: &[MapKeyframe]| around.iter().all(|k| k.odom_frame_id == frame);
        keyframes
            .get(around)
            .filter(|around| is_one_frame(around))?;
        let kept: Vec<usize> = (0..stretch.start)
            .filter(|index| graph.is_unknown(KeyframeIdx(*index)))
            .collect();
        let mut stands_on = Vec::with_capacity(stretch.len());
        for keyframe in stretch.clone().map(KeyframeIdx) {
            let to = self.longest_alone(keyframe, &kept, &stands_on, keyframes, graph)?;
            stands_on.push(to);
        }
        Some(stands_on)
    }

    /// Whether the graph knows where a stretch is, seen from a keyframe that it is to stand on: to
    /// a keyframe distance, as far as one place reaches. Odometry holds its keyframes together.
    fn is_located(
        &self,
        stretch: &Range<usize>,
        stands_on: &[KeyframeIdx],
        graph: &mut KeyframeGraph,
    ) -> bool {
        let mut pairs = stands_on.iter().zip(stretch.clone().map(KeyframeIdx));
        pairs.any(|(to, keyframe)| {
            let prior = graph.prior(*to, keyframe);
            prior.is_some_and(|prior| prior.sigma_m() <= self.step_m)
        })
    }

    /// Of the kept keyframes at a keyframe's place the one that was passed longest ago, where they
    /// are of enough laps. As many laps later the newest is seen at all of them. Those that are
    /// `taken` come last.
    fn longest_alone(
        &self,
        keyframe: KeyframeIdx,
        kept: &[usize],
        taken: &[KeyframeIdx],
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Option<KeyframeIdx> {
        let component = graph.component_of(keyframe);
        let here = graph.pose(keyframe)?.translation();
        let path_m = keyframes.get(keyframe.0)?.path_m;
        let (mut longest, mut laps, mut lap_m) = (None, 0, f64::NEG_INFINITY);
        for other in kept.iter().copied().map(KeyframeIdx) {
            let other_m = keyframes.get(other.0)?.path_m;
            let away_m = (graph.pose(other)?.translation() - here).norm();
            let is_here = away_m <= self.step_m && path_m - other_m >= self.lap_min_m;
            if is_here && graph.component_of(other) == component {
                if other_m - lap_m >= self.lap_min_m {
                    laps += 1;
                    lap_m = other_m;
                }
                let passed = (taken.contains(&other), graph.newest_at(other), other);
                longest = Some(longest.map_or(passed, |least| passed.min(least)));
            }
        }
        let (_, _, longest) = longest?;
        (laps >= self.laps_max).then_some(longest)
    }
}

/// What the closures say of a stretch.
#[derive(Default)]
struct Loops {
    /// Loops that lead from it to kept ground.
    found: usize,
    /// Those of them that are edges of the graph.
    edges: usize,
    /// Candidates that look like other ground.
    unlike: usize,
    /// Edges that lead from behind it to ground before it.
    behind: usize,
}

impl Loops {
    fn new(stretch: &Range<usize>, closures: &[LoopClosure], graph: &KeyframeGraph) -> Self {
        let mut loops = Self::default();
        // They came in the order of their newer keyframes, but for those of merged components.
        let of_later = closures.iter().rev();
        for closure in of_later.take_while(|it| it.newer.0 >= stretch.start) {
            let is_kept = graph.is_unknown(closure.older);
            if closure.older.0 >= stretch.start || !is_kept {
                continue;
            }
            let is_edge = usize::from(closure.status == LoopStatus::Accepted);
            if closure.newer.0 >= stretch.end {
                loops.behind += is_edge;
                continue;
            }
            loops.edges += is_edge;
            loops.found += usize::from(closure.status.is_loop());
            let is_unlike = matches!(closure.status, LoopStatus::Unlike | LoopStatus::Divergent);
            loops.unlike += usize::from(is_unlike);
        }
        loops
    }

    /// Whether the place looks as it did. One that has changed keeps its witnesses.
    fn show_known_ground(&self) -> bool {
        self.found > self.unlike
    }

    /// Whether they say nothing at all: where too little is seen, no lap ever finds a loop.
    fn show_nothing(&self) -> bool {
        self.found == 0 && self.unlike == 0
    }
}

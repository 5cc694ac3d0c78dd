//! How good a trajectory and its loops are, all figures together.

use crate::{final_poses::final_poses, found_loops, job::Done};
use randt_evaluation::{
    Error, Evaluation, LoopEdge, LoopEvaluation, LoopLimits, Track, Trajectory, evaluate,
    evaluate_loops, track,
};

/// All that is said against the truth.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// Errors of the poses.
    pub evaluation: Evaluation,
    /// Worst errors of the motion.
    pub track: Track,
    /// The loops, where any were to be judged.
    pub loops: Option<LoopEvaluation>,
}

impl Judgement {
    /// Judges a trajectory, and the loops that made it.
    pub fn new(
        estimate: &Trajectory,
        truth: &Trajectory,
        loops: Option<&[LoopEdge]>,
        limits: &LoopLimits,
    ) -> Result<Self, Error> {
        let judge = |loops| evaluate_loops(loops, estimate, truth, limits);
        Ok(Self {
            evaluation: evaluate(estimate, truth)?,
            track: track(estimate, truth),
            loops: loops.map(judge).transpose()?,
        })
    }

    /// Judges the final poses of a computation whose input has the truth.
    pub fn from_run(done: &Done) -> Result<Self, Error> {
        let mapper = done.pipeline.mapper();
        let trajectory = final_poses(&done.results.states, mapper);
        Self::new(
            &trajectory,
            done.results.truth(),
            Some(&found_loops::from_mapper(mapper)),
            &LoopLimits::default(),
        )
    }
}

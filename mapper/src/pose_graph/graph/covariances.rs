//! How well the graph knows one node from another, and when its equations are factorised for that.

use super::super::covariance;
use super::super::solver::{Term, factorised};
use super::super::system::System;
use super::super::tail::Tail;
use super::super::{Edge, Error};
use super::{LOOP_LOSS, PoseGraph, terms};
use crate::index::KeyframeIdx;
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// Nodes behind the factorised ones: every covariance costs the square of them, and a factor that
/// is made anew the whole map.
const TAIL_MAX: usize = 16;

/// How well all nodes are known from each other at the estimate.
pub struct Marginals<'a> {
    poses: &'a [Pose2],
    system: System,
}

impl Marginals<'_> {
    /// Covariance of the pose of `j` seen from `i`, as [`PoseGraph::relative_covariance`] has it;
    /// `None` where no edges connect them.
    pub fn relative(&self, i: KeyframeIdx, j: KeyframeIdx) -> Option<Matrix3<f64>> {
        let is_there = |node: KeyframeIdx| node.0 < self.poses.len();
        let found = || covariance::relative(&self.system, self.poses, i, j).ok();
        (is_there(i) && is_there(j)).then(found)?
    }
}

impl PoseGraph {
    /// All covariances by one factorisation, where many are asked for and the graph stays as it is.
    pub fn marginals(&self) -> Result<Marginals<'_>, Error> {
        let terms: Vec<Term<'_>> = terms(&self.odometry, &self.loops, LOOP_LOSS).collect();
        let mut system = None;
        factorised(&mut system, &self.poses, &terms)?;
        let poses = &self.poses;
        let system = system.ok_or(Error::Singular {
            unknowns: poses.len(),
            damping: 0.0,
        })?;
        Ok(Marginals { poses, system })
    }

    /// Covariance of the pose of `j` seen from `i`, with perturbations on the right (in the frame
    /// of `j`); m^2, m rad, rad^2. By odometry and the loops that are on, at the estimate.
    pub fn relative_covariance(
        &mut self,
        i: KeyframeIdx,
        j: KeyframeIdx,
    ) -> Result<Matrix3<f64>, Error> {
        let count = self.poses.len();
        if let Some(node) = [i.0, j.0].into_iter().find(|node| *node >= count) {
            return Err(Error::NoNode { node, count });
        }
        let (from, to) = (i.0, j.0);
        if self.component[from] != self.component[to] {
            return Err(Error::NotConnected { from, to });
        }
        if let Some(node) = [i, j].into_iter().find(|node| !self.is_unknown(*node)) {
            return Err(Error::Marginalized(node.0));
        }
        let tail = match self.tail.take() {
            Some(tail) => tail,
            None => self.new_tail()?,
        };
        let tail = self.tail.insert(tail);
        let system = self.system.as_ref();
        let covariance = system.map(|system| tail.relative(system, &self.poses, i, j));
        covariance.ok_or(Error::Singular {
            unknowns: count,
            damping: 0.0,
        })
    }

    /// How often the equations were factorised.
    pub fn factorisations(&self) -> u64 {
        self.system
            .as_ref()
            .map_or(0, |system| system.factorisations)
    }

    /// Factorises where that is due, and adds what came since.
    fn new_tail(&mut self) -> Result<Tail, Error> {
        let count = self.poses.len();
        for first in [self.factorised_nodes(), count] {
            let is_old = |edge: &Edge| edge.from.0.max(edge.to.0) < first;
            let terms = terms(&self.odometry, &self.loops, LOOP_LOSS);
            let terms: Vec<Term<'_>> = terms.filter(|(edge, _)| is_old(edge)).collect();
            let system = factorised(&mut self.system, &self.poses[..first], &terms)?;
            let new: Vec<&Edge> = self.odometry.iter().filter(|edge| !is_old(edge)).collect();
            if let Some(tail) = Tail::new(system, first, &self.poses, &new) {
                return Ok(tail);
            }
        }
        Err(Error::Singular {
            unknowns: count,
            damping: 0.0,
        })
    }

    /// How many nodes are to be factorised: those that loops lead to and first ones of components,
    /// and the others from time to time. It follows from the graph alone, so that one that comes
    /// back computes the same bits.
    fn factorised_nodes(&self) -> usize {
        let loops = self.loops.iter().map(|l| l.edge.from.max(l.edge.to).0);
        let held = loops.chain(self.component.iter().map(|component| component.0));
        let held = held.max().map_or(0, |node| node + 1);
        held + (self.poses.len() - held) / TAIL_MAX * TAIL_MAX
    }
}

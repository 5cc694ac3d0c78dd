//! The graph after new loops: optimised, and rid of loops that proved wrong.

use super::Mapper;
use crate::{Fate, graph::LoopId};

/// Weight below which a loop has proved wrong: the rest of the map disagrees with it.
const WEIGHT_MIN: f64 = 0.3;

impl Mapper {
    /// Optimises; takes out loops that proved wrong and optimises again.
    pub(super) fn settle(&mut self) {
        loop {
            if self.graph.optimise().is_err() {
                self.counters.solver_failures += 1;
                return;
            }
            if !self.config.loops.verify || !self.withdraw() {
                return;
            }
        }
    }

    /// Judges all loops anew, as if the drive were driven again: one that was let in while the map was uncertain can
    /// prove wrong by what came later.
    pub(super) fn recheck(&mut self) {
        if self.config.loops.verify && !self.loops.is_empty() {
            if self.graph.recheck().is_err() {
                self.counters.solver_failures += 1;
            }
            self.withdraw();
        }
        self.settle();
    }

    /// Takes out the loops that the graph has switched off; whether there were any.
    fn withdraw(&mut self) -> bool {
        let wrong: Vec<_> = self
            .graph
            .loops()
            .iter()
            .filter(|l| l.weight < WEIGHT_MIN)
            .map(|l| l.id)
            .collect();
        self.remove(&wrong);
        !wrong.is_empty()
    }

    /// Takes loops out of the graph.
    pub(super) fn remove(&mut self, wrong: &[LoopId]) {
        for id in wrong {
            self.graph.remove_loop(*id);
            if let Some(at) = self.loops.iter().position(|(name, _)| name == id) {
                let (_, candidate) = self.loops.remove(at);
                if let Some(candidate) = self.candidates.get_mut(candidate) {
                    candidate.fate = Fate::Withdrawn;
                }
            }
        }
    }
}

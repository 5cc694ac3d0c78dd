//! Covariances by the factor that is there: one walk up the elimination tree for each node, where
//! a solution would pass every pose of the map.

use super::{DOF, System};
use crate::index::KeyframeIdx;
use faer::sparse::linalg::cholesky::SymbolicCholeskyRaw;
use nalgebra::Matrix3;

/// L^-1 J^T of three linear functions J of the unknowns, H = L L^T, by its rows that are not zero:
/// products of two of them are covariances, J H^-1 K^T.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Whitened(Vec<(usize, [f64; DOF])>);

impl Whitened {
    /// The covariance of two of them.
    pub fn covariance(&self, other: &Self) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        let mut others = other.0.iter().peekable();
        for (row, own) in &self.0 {
            while others.next_if(|(other, _)| other < row).is_some() {}
            if let Some((_, other)) = others.next_if(|(other, _)| other == row) {
                for i in 0..DOF {
                    for j in 0..DOF {
                        sum[(i, j)] += own[i] * other[j];
                    }
                }
            }
        }
        sum
    }
}

impl System {
    /// What nodes' perturbations add up to, each by its matrix, whitened by the last
    /// factorisation; an anchor has none.
    pub fn whitened(&self, terms: &[(KeyframeIdx, &Matrix3<f64>)]) -> Whitened {
        // `symbolic` asks for this one.
        let SymbolicCholeskyRaw::Simplicial(shape) = self.symbolic.raw() else {
            return Whitened::default();
        };
        let (starts, rows) = (shape.col_ptr(), shape.row_idx());
        // A column's diagonal, then what is below it: the first row is its parent in the tree.
        let column = |at: usize| starts[at]..starts[at + 1];
        let mut entries: Vec<(usize, [f64; DOF])> = Vec::with_capacity(2 * DOF);
        for (node, by) in terms {
            let Some(block) = self.block_of[node.0] else {
                continue;
            };
            for unknown in 0..DOF {
                let at = self.position[DOF * block + unknown];
                entries.push((at, core::array::from_fn(|row| by[(row, unknown)])));
            }
        }
        let mut reached: Vec<usize> = Vec::new();
        for (at, _) in &entries {
            let ways = std::iter::successors(Some(*at), |at| rows[column(*at)].get(1).copied());
            reached.extend(ways);
        }
        reached.sort_unstable();
        reached.dedup();
        let mut sums: Vec<(usize, [f64; DOF])> = Vec::with_capacity(reached.len());
        sums.extend(reached.iter().map(|at| (*at, [0.0; DOF])));
        let place = |at: usize| reached.partition_point(|other| *other < at);
        for (at, values) in entries {
            let sum = &mut sums[place(at)].1;
            (0..DOF).for_each(|i| sum[i] += values[i]);
        }
        for index in 0..sums.len() {
            let (at, mut values) = sums[index];
            let range = column(at);
            let diagonal = self.factor[range.start];
            values.iter_mut().for_each(|value| *value /= diagonal);
            sums[index].1 = values;
            // All rows below lie on the way to the root.
            let mut below = index;
            for entry in range.skip(1) {
                while sums[below].0 < rows[entry] {
                    below += 1;
                }
                let sum = &mut sums[below].1;
                (0..DOF).for_each(|i| sum[i] -= self.factor[entry] * values[i]);
            }
        }
        Whitened(sums)
    }
}

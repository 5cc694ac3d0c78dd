//! The normal equations of a graph: their sparsity, their factorisation, their solution.
//!
//! Responsible for the only numbers that faer computes. Not responsible for what the edges mean.

mod whitened;

pub(super) use whitened::Whitened;

use super::Error;
use super::components::components;
use crate::index::KeyframeIdx;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::{SupernodalThreshold, amd};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};
use nalgebra::{Matrix3, Vector3};

/// Unknowns of one pose.
pub(super) const DOF: usize = 3;

/// Where an edge adds to the lower triangle.
#[derive(Clone, Copy)]
struct EdgeBlocks {
    /// Blocks of the two nodes; `None` for an anchor, which stands still.
    blocks: [Option<usize>; 2],
    /// Which block below the diagonal of the lower-numbered one's column; 0 where one is an
    /// anchor.
    below: usize,
}

/// H step = -g, with H in 3 x 3 blocks.
///
/// The lowest node of every component is its anchor and no unknown. Sparsity, ordering and
/// symbolic factorisation are made once and serve as long as the same nodes are connected. Its
/// fields are those, the sums, and the factor.
pub(super) struct System {
    component: Vec<usize>,
    pairs: Vec<(usize, usize)>,
    block_of: Vec<Option<usize>>,
    edges: Vec<EdgeBlocks>,
    columns: Vec<usize>,
    rows: Vec<usize>,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    /// For every unknown when it is eliminated.
    position: Vec<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
    /// Whether `factor` is that of H as it is, not damped.
    pub factorised: bool,
    /// How often this system and those before it were factorised.
    pub factorisations: u64,
}

impl System {
    /// The equations of edges between these pairs of nodes.
    pub fn new(nodes: usize, pairs: Vec<(usize, usize)>) -> Result<Self, Error> {
        let component = components(nodes, pairs.iter().copied());
        let mut blocks = 0;
        let block_of = (0..nodes).map(|node| {
            let is_unknown = component[node] != node;
            blocks += usize::from(is_unknown);
            is_unknown.then(|| blocks - 1)
        });
        let block_of: Vec<Option<usize>> = block_of.collect();
        let below = blocks_below(blocks, &pairs, &block_of);
        let edges = pairs.iter().map(|&(from, to)| {
            let blocks = [block_of[from], block_of[to]];
            let below = match blocks {
                [Some(a), Some(b)] => below[a.min(b)].partition_point(|row| *row < a.max(b)),
                _ => 0,
            };
            EdgeBlocks { blocks, below }
        });
        let edges = edges.collect();
        let (columns, rows) = scalar_pattern(&below);
        let fail = |error: FaerError| Error::Factorisation {
            unknowns: blocks,
            what: error.to_string(),
        };
        let symbolic = symbolic(&below, &columns, &rows).map_err(fail)?;
        let request = StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        ]);
        let order = symbolic.perm().map(|perm| perm.arrays().1.to_vec());
        let memory = MemBuffer::try_new(request).map_err(|_| fail(FaerError::OutOfMemory))?;
        Ok(Self {
            component,
            hessian: vec![0.0; rows.len()],
            gradient: vec![0.0; DOF * blocks],
            factor: vec![0.0; symbolic.len_val()],
            pairs,
            block_of,
            edges,
            columns,
            rows,
            position: order.unwrap_or_else(|| (0..DOF * blocks).collect()),
            symbolic,
            memory,
            factorised: false,
            factorisations: 0,
        })
    }

    /// Whether these are the nodes and pairs that it was made for.
    pub fn fits(&self, nodes: usize, pairs: impl Iterator<Item = (usize, usize)>) -> bool {
        self.component.len() == nodes && pairs.eq(self.pairs.iter().copied())
    }

    /// Poses that are unknown.
    pub fn unknowns(&self) -> usize {
        self.gradient.len() / DOF
    }

    /// The lowest node of a node's component.
    pub fn component_of(&self, node: KeyframeIdx) -> usize {
        self.component[node.0]
    }

    /// Whether a chain of edges connects two of its nodes.
    pub fn connected(&self, a: KeyframeIdx, b: KeyframeIdx) -> bool {
        self.component[a.0] == self.component[b.0]
    }

    /// Forgets the sums.
    pub fn clear(&mut self) {
        self.hessian.fill(0.0);
        self.gradient.fill(0.0);
    }

    /// Adds the edge of the pair at `index`: its error, its derivatives and its information,
    /// weight included.
    pub fn add(
        &mut self,
        index: usize,
        error: &Vector3<f64>,
        jacobians: &[Matrix3<f64>; 2],
        information: &Matrix3<f64>,
    ) {
        let EdgeBlocks { blocks, below } = self.edges[index];
        for (block, jacobian) in blocks.iter().zip(jacobians) {
            let Some(block) = *block else { continue };
            let weighed = jacobian.transpose() * information;
            let diagonal = weighed * jacobian;
            let gradient = weighed * error;
            for column in 0..DOF {
                let start = self.columns[DOF * block + column];
                for row in column..DOF {
                    self.hessian[start + row - column] += diagonal[(row, column)];
                }
                self.gradient[DOF * block + column] += gradient[column];
            }
        }
        if let [Some(a), Some(b)] = blocks {
            // The lower triangle has the higher block's rows.
            let cross = jacobians[1].transpose() * information * jacobians[0];
            let cross = if a < b { cross } else { cross.transpose() };
            for column in 0..DOF {
                let start = self.columns[DOF * a.min(b) + column] + (DOF - column) + DOF * below;
                for row in 0..DOF {
                    self.hessian[start + row] += cross[(row, column)];
                }
            }
        }
    }

    /// Factorises H with its diagonal raised by `damping` times itself; false where it is not
    /// positive definite.
    pub fn factorise(&mut self, damping: f64) -> bool {
        self.factorised = self.unknowns() == 0;
        if self.factorised {
            return true;
        }
        self.factorisations += 1;
        let mut damped;
        let mut hessian = &self.hessian;
        if damping > 0.0 {
            damped = self.hessian.clone();
            for start in &self.columns[..self.gradient.len()] {
                damped[*start] *= 1.0 + damping;
            }
            hessian = &damped;
        }
        let pattern = pattern(&self.columns, &self.rows);
        let factorised = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            SparseColMatRef::new(pattern, hessian),
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Spec::default(),
        );
        let good = factorised.is_ok() && self.factor.iter().all(|value| value.is_finite());
        self.factorised = good && damping == 0.0;
        good
    }

    /// The step of every unknown pose by the last factorisation.
    pub fn step(&mut self) -> Vec<f64> {
        let mut step: Vec<f64> = self.gradient.iter().map(|value| -value).collect();
        if !step.is_empty() {
            let size = step.len();
            let right = MatMut::from_column_major_slice_mut(&mut step, size, 1);
            LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
                Conj::No,
                right,
                Par::Seq,
                MemStack::new(&mut self.memory),
            );
        }
        step
    }

    /// The part of a step that belongs to a node; an anchor has none.
    pub fn node_step(&self, step: &[f64], node: usize) -> Option<[f64; 3]> {
        let first = DOF * self.block_of[node]?;
        Some([step[first], step[first + 1], step[first + 2]])
    }
}

/// For every block's column the blocks below its diagonal, rising.
fn blocks_below(
    blocks: usize,
    pairs: &[(usize, usize)],
    block_of: &[Option<usize>],
) -> Vec<Vec<usize>> {
    let mut below = vec![Vec::new(); blocks];
    for &(from, to) in pairs {
        if let (Some(a), Some(b)) = (block_of[from], block_of[to]) {
            below[a.min(b)].push(a.max(b));
        }
    }
    for rows in &mut below {
        rows.sort_unstable();
        rows.dedup();
    }
    below
}

/// Starts of the columns and rows of the values of the lower triangle.
fn scalar_pattern(below: &[Vec<usize>]) -> (Vec<usize>, Vec<usize>) {
    let mut columns = vec![0];
    let mut rows = Vec::new();
    for (block, below) in below.iter().enumerate() {
        for column in 0..DOF {
            rows.extend((column..DOF).map(|row| DOF * block + row));
            rows.extend(scalars(below));
            columns.push(rows.len());
        }
    }
    (columns, rows)
}

/// The unknowns of blocks.
fn scalars(blocks: &[usize]) -> impl Iterator<Item = usize> {
    let unknowns = |block| (0..DOF).map(move |unknown| DOF * block + unknown);
    blocks.iter().flat_map(unknowns)
}

fn pattern<'a>(columns: &'a [usize], rows: &'a [usize]) -> SymbolicSparseColMatRef<'a, usize> {
    let size = columns.len() - 1;
    SymbolicSparseColMatRef::new_checked(size, size, columns, None, rows)
}

/// Orders blocks by approximate minimum degree (a ninth of the scalars' work) and factorises the
/// pattern. The factorisation goes scalar by scalar: graphs of drives are too thin for dense
/// blocks to pay, and those would be multiplied by instructions that depend on the machine.
fn symbolic(
    below: &[Vec<usize>],
    columns: &[usize],
    rows: &[usize],
) -> Result<SymbolicCholesky<usize>, FaerError> {
    let blocks = below.len();
    let mut starts = vec![0];
    let mut block_rows = Vec::new();
    for rows in below {
        block_rows.extend_from_slice(rows);
        starts.push(block_rows.len());
    }
    let mut order = vec![0; blocks];
    let mut inverse = vec![0; blocks];
    let request = amd::order_scratch::<usize>(blocks, block_rows.len());
    let mut memory = MemBuffer::try_new(request).map_err(|_| FaerError::OutOfMemory)?;
    amd::order(
        &mut order,
        &mut inverse,
        pattern(&starts, &block_rows),
        amd::Control::default(),
        MemStack::new(&mut memory),
    )?;
    let order: Vec<usize> = scalars(&order).collect();
    let mut inverse = vec![0; order.len()];
    for (position, index) in order.iter().enumerate() {
        inverse[*index] = position;
    }
    factorize_symbolic_cholesky(
        pattern(columns, rows),
        Side::Lower,
        SymmetricOrdering::Custom(PermRef::new_checked(&order, &inverse, order.len())),
        CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..CholeskySymbolicParams::default()
        },
    )
}

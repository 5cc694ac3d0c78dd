//! Nodes that odometry has added since the equations were factorised.
//!
//! They hang on few of the nodes before: on the last one, and on roots of submaps. A small dense
//! system of these and of the new ones updates all covariances exactly, where factorising anew
//! would pass the whole map for every keyframe.

use super::dense::Dense;
use super::edge::Edge;
use super::system::{DOF, System, Whitened};
use crate::index::KeyframeIdx;
use nalgebra::{Matrix3, RowVector3, Vector3};
use randt_geometry::Pose2;

/// The nodes behind those that were factorised, with those before that they hang on.
///
/// What the factor leaves open about the border is C z, z of unit covariance: the unknowns are z
/// and the new nodes' perturbations.
pub(super) struct Tail {
    /// How many were factorised.
    first: usize,
    /// The border: of these the ones that edges of new nodes lead to, but for anchors.
    whitened: Vec<Whitened>,
    /// C, the border's covariance by the factor being C C^T.
    spread: Dense,
    /// Of z and the new nodes, factorised.
    information: Dense,
}

impl Tail {
    /// The nodes from `first` on, which these edges lead to; `None` where they connect what the
    /// factor has for separate, or where rounding leaves nothing of what the border is known by.
    pub fn new(system: &System, first: usize, poses: &[Pose2], edges: &[&Edge]) -> Option<Self> {
        let ends = edges.iter().flat_map(|edge| [edge.from, edge.to]);
        let mut border: Vec<KeyframeIdx> = ends.filter(|node| node.0 < first).collect();
        border.sort_unstable();
        border.dedup();
        let mut components = border.iter().map(|node| system.component_of(*node));
        let component = components.next();
        if components.any(|other| Some(other) != component) {
            return None;
        }
        border.retain(|node| Some(node.0) != component);
        let whitened = border.iter();
        let whitened = whitened.map(|node| system.whitened(&[(*node, &Matrix3::identity())]));
        let whitened: Vec<Whitened> = whitened.collect();
        let mut spread = Dense::zeros(DOF * border.len());
        for (i, a) in whitened.iter().enumerate() {
            for (j, b) in whitened.iter().enumerate().take(i + 1) {
                let block = a.covariance(b);
                for (row, column) in (0..DOF * DOF).map(|at| (at / DOF, at % DOF)) {
                    *spread.at(DOF * i + row, DOF * j + column) = block[(row, column)];
                }
            }
        }
        let spread = spread.cholesky()?;
        let known = spread.size();
        let mut information = Dense::zeros(known + DOF * (poses.len() - first));
        (0..known).for_each(|at| *information.at(at, at) = 1.0);
        for edge in edges {
            let by = edge.derivatives(&poses[edge.from.0], &poses[edge.to.0]);
            // The error's derivative by every unknown that it depends on.
            let mut columns: Vec<(usize, Vector3<f64>)> = Vec::new();
            for (node, by) in [edge.from, edge.to].iter().zip(&by) {
                if let Some(new) = node.0.checked_sub(first) {
                    let at = known + DOF * new;
                    columns.extend((0..DOF).map(|axis| (at + axis, by.column(axis).into_owned())));
                } else if let Ok(index) = border.binary_search(node) {
                    for axis in 0..DOF {
                        let row = spread.row(DOF * index + axis).iter().enumerate();
                        columns.extend(row.map(|(at, spread)| (at, by.column(axis) * *spread)));
                    }
                }
            }
            for (row, by_row) in &columns {
                let weighed: RowVector3<f64> = by_row.transpose() * edge.information;
                for (column, by_column) in columns.iter().filter(|(column, _)| column <= row) {
                    *information.at(*row, *column) += (weighed * by_column).x;
                }
            }
        }
        Some(Self {
            first,
            whitened,
            spread,
            information: information.cholesky()?,
        })
    }

    /// Covariance of the pose of `j` seen from `i`, perturbations on the right.
    pub fn relative(
        &self,
        system: &System,
        poses: &[Pose2],
        i: KeyframeIdx,
        j: KeyframeIdx,
    ) -> Matrix3<f64> {
        // d_j - Ad(T_ij^-1) d_i is the perturbation of T_ij.
        let by_i = -poses[i.0].between(&poses[j.0]).inverse().adjoint();
        let terms = [(i, &by_i), (j, &Matrix3::identity())];
        let is_new = |(node, _): &(KeyframeIdx, _)| node.0 >= self.first;
        let (new, old): (Vec<_>, Vec<_>) = terms.into_iter().partition(is_new);
        let whitened = system.whitened(&old);
        // How it goes together with z, then with the new nodes.
        let mut rows = vec![[0.0; DOF]; self.information.size()];
        let (by_border, by_new) = rows.split_at_mut(self.spread.size());
        for (rows, border) in by_border.chunks_exact_mut(DOF).zip(&self.whitened) {
            let block = border.covariance(&whitened);
            for (row, values) in rows.iter_mut().enumerate() {
                *values = core::array::from_fn(|column| block[(row, column)]);
            }
        }
        self.spread.solve(by_border);
        // The factor's, without what it knows by way of the border ...
        let mut covariance = whitened.covariance(&whitened) - square(by_border);
        for (node, by) in new {
            let rows = by_new.iter_mut().skip(DOF * (node.0 - self.first));
            for (column, values) in rows.take(DOF).enumerate() {
                (0..DOF).for_each(|row| values[row] += by[(row, column)]);
            }
        }
        // ... which border and new nodes say together.
        self.information.solve(&mut rows);
        covariance += square(&rows);
        (covariance + covariance.transpose()) * 0.5
    }
}

/// Rows^T rows.
fn square(rows: &[[f64; DOF]]) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    for row in rows {
        for (i, j) in (0..DOF * DOF).map(|at| (at / DOF, at % DOF)) {
            sum[(i, j)] += row[i] * row[j];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::PoseGraph;
    use super::super::testing::{add_intra_submap_constraints, close, drifting, edge};
    use super::*;

    /// A solved graph of two laps, and nodes that odometry has added to it, each held by the one
    /// before and by a node of the map.
    fn grown(added: usize) -> PoseGraph {
        let mut graph = drifting(80);
        add_intra_submap_constraints(&mut graph);
        close(&mut graph, 5);
        graph.optimise().unwrap();
        for node in 81..81 + added {
            let step = edge(node - 1, node, Pose2::new(1.0, 0.1, 0.2));
            graph.append(step).unwrap();
            let (root, pose) = (graph.poses()[70], graph.poses()[node]);
            let by_root = edge(70, node, root.between(&pose));
            graph.add_odometry(by_root).unwrap();
        }
        graph
    }

    fn covariances(graph: &mut PoseGraph) -> Vec<Matrix3<f64>> {
        let last = graph.poses().len() - 1;
        let pairs = [(0, last), (3, 44), (69, 70), (70, last), (last, 12)];
        let tail = [(last - 1, last), (last - 4, last), (last, 70)];
        let mut covariance = |(i, j)| graph.relative_covariance(KeyframeIdx(i), KeyframeIdx(j));
        (pairs.into_iter().chain(tail))
            .map(|pair| covariance(pair).unwrap())
            .collect()
    }

    #[test]
    fn new_nodes_cost_no_factorisation_and_change_nothing() {
        for added in [1, 5, 15] {
            let mut graph = grown(added);
            covariances(&mut grown(0));
            let found = covariances(&mut graph);
            // A loop that says nothing has all of it factorised.
            let mut nothing = edge(80, 80 + added, Pose2::IDENTITY);
            nothing.measured = graph.poses()[80].between(&graph.poses()[80 + added]);
            nothing.information *= 1e-12;
            graph.add_loop(nothing).unwrap();
            for (found, whole) in found.iter().zip(covariances(&mut graph)) {
                let off = (found - whole).amax();
                assert!(off < 1e-9 * whole.amax(), "{added}: {found} {whole}");
            }
        }
    }

    #[test]
    fn it_is_factorised_again_from_time_to_time() {
        let mut graph = grown(0);
        covariances(&mut graph);
        let before = graph.factorisations();
        for node in 81..145 {
            let step = edge(node - 1, node, Pose2::new(1.0, 0.1, 0.2));
            graph.append(step).unwrap();
            graph
                .relative_covariance(KeyframeIdx(0), KeyframeIdx(node))
                .unwrap();
        }
        assert_eq!(graph.factorisations() - before, 4);
    }

    #[test]
    fn a_graph_that_comes_back_computes_the_same_bits() {
        for added in [3, 15, 16, 21] {
            let mut graph = grown(added);
            // At every node, as a mapper asks.
            covariances(&mut graph);
            let (poses, odometry) = (graph.poses().to_vec(), graph.odometry().to_vec());
            let loops = graph.loops().to_vec();
            let mut again = PoseGraph::restore(poses, Vec::new(), odometry, loops, 1000).unwrap();
            assert_eq!(covariances(&mut graph), covariances(&mut again));
        }
    }

    #[test]
    fn what_new_nodes_connect_is_factorised_with_them() {
        let mut graph = drifting(20);
        let other = graph.add_node(Pose2::new(30.0, 0.0, 0.0)).unwrap();
        for node in 22..37 {
            let step = edge(node - 1, node, Pose2::new(1.0, 0.0, 0.0));
            graph.append(step).unwrap();
        }
        graph
            .add_odometry(edge(3, 36, Pose2::new(1.0, 0.0, 0.0)))
            .unwrap();
        let covariance = graph.relative_covariance(KeyframeIdx(0), other).unwrap();
        // Three steps, one across, fifteen back.
        assert!(
            (covariance[(2, 2)] - 19.0 / 365.0).abs() < 1e-9,
            "{covariance}"
        );
    }
}

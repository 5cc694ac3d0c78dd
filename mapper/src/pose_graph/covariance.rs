//! How well one node is known from another.

use super::Error;
use super::system::System;
use crate::index::KeyframeIdx;
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// Covariance of `j` seen from `i`, perturbations on the right, by equations that are factorised.
pub(super) fn relative(
    system: &System,
    poses: &[Pose2],
    i: KeyframeIdx,
    j: KeyframeIdx,
) -> Result<Matrix3<f64>, Error> {
    if !system.connected(i, j) {
        return Err(Error::NotConnected { from: i.0, to: j.0 });
    }
    // d_j - Ad(T_ij^-1) d_i is the perturbation of T_ij.
    let by_i = -poses[i.0].between(&poses[j.0]).inverse().adjoint();
    let whitened = system.whitened(&[(i, &by_i), (j, &Matrix3::identity())]);
    Ok(whitened.covariance(&whitened))
}

#[cfg(test)]
mod tests {
    use super::super::edge::moved;
    use super::super::testing::{add_intra_submap_constraints, close, drifting, edge};
    use super::super::{Edge, PoseGraph};
    use super::*;
    use nalgebra::SMatrix;

    /// By indices.
    fn relative_covariance(
        graph: &mut PoseGraph,
        i: usize,
        j: usize,
    ) -> Result<Matrix3<f64>, Error> {
        graph.relative_covariance(KeyframeIdx(i), KeyframeIdx(j))
    }

    fn close_to(a: &Matrix3<f64>, b: &Matrix3<f64>) -> bool {
        (a - b).amax() < 1e-9 * a.amax().max(b.amax())
    }

    #[test]
    fn it_is_the_inverse_of_the_dense_information() {
        let mut graph = drifting(3);
        graph
            .add_loop(edge(0, 3, Pose2::new(2.9, 0.1, 0.1)))
            .unwrap();
        graph
            .add_loop(edge(3, 1, Pose2::new(-2.0, 0.1, -0.1)))
            .unwrap();
        // Odometry that is no chain.
        graph
            .add_odometry(edge(0, 2, Pose2::new(2.0, 0.1, 0.1)))
            .unwrap();
        graph.optimise_trusting().unwrap();
        // Derivatives of all errors by finite differences; node 0 stands still.
        let poses = graph.poses().to_vec();
        let edges: Vec<Edge> = (graph.odometry().iter().cloned())
            .chain(graph.loops().iter().map(|l| l.edge.clone()))
            .collect();
        let mut dense = SMatrix::<f64, 9, 9>::zeros();
        for edge in &edges {
            let error = |axis: usize, size: f64| {
                let mut poses = poses.clone();
                let mut step = [0.0; 3];
                step[axis % 3] = size;
                poses[1 + axis / 3] = moved(&poses[1 + axis / 3], &step);
                edge.error(&poses[edge.from.0], &poses[edge.to.0])
            };
            let jacobian =
                SMatrix::<f64, 3, 9>::from_columns(&std::array::from_fn::<_, 9, _>(|axis| {
                    (error(axis, 1e-5) - error(axis, -1e-5)) / 2e-5
                }));
            dense += jacobian.transpose() * edge.information * jacobian;
        }
        let covariance = dense.try_inverse().unwrap();
        for (i, j) in [(1, 3), (3, 1), (2, 3), (0, 2), (2, 0)] {
            let by_i = -poses[i].between(&poses[j]).inverse().adjoint();
            let mut by = SMatrix::<f64, 3, 9>::zeros();
            if i > 0 {
                by.fixed_view_mut::<3, 3>(0, 3 * (i - 1)).copy_from(&by_i);
            }
            if j > 0 {
                by.fixed_view_mut::<3, 3>(0, 3 * (j - 1))
                    .copy_from(&Matrix3::identity());
            }
            let expected = by * covariance * by.transpose();
            let found = relative_covariance(&mut graph, i, j).unwrap();
            assert!(
                (found - expected).amax() < 1e-6 * expected.amax(),
                "{i} {j}: {found} {expected}"
            );
        }
    }

    #[test]
    fn odometry_carries_it_on_to_new_nodes() {
        let mut graph = drifting(80);
        close(&mut graph, 5);
        graph.optimise_trusting().unwrap();
        for node in 81..90 {
            graph
                .append(edge(node - 1, node, Pose2::new(1.0, 0.1, 0.2)))
                .unwrap();
        }
        let branch = graph
            .append(edge(85, 90, Pose2::new(0.0, 1.0, -2.0)))
            .unwrap()
            .0;
        let pairs = [
            (3, 89),
            (89, 3),
            (82, 88),
            (88, 82),
            (80, 84),
            (branch, 89),
            (7, branch),
            (84, 84),
        ];
        let before = pairs.map(|(i, j)| relative_covariance(&mut graph, i, j).unwrap());
        // New nodes that no loop holds move nothing: what was carried on is the optimum.
        graph.optimise_trusting().unwrap();
        for ((i, j), before) in pairs.into_iter().zip(before) {
            let after = relative_covariance(&mut graph, i, j).unwrap();
            assert!(
                i == j || close_to(&before, &after),
                "{i} {j}: {before} {after}"
            );
            assert!(i != j || before.amax() < 1e-12);
        }
    }

    #[test]
    fn intra_submap_constraints_sharpen_what_the_chain_says_before_anything_is_optimised() {
        let (mut chain, mut constrained) = (drifting(70), drifting(70));
        add_intra_submap_constraints(&mut constrained);
        let before = relative_covariance(&mut constrained, 3, 68).unwrap();
        assert!(before.trace() < 0.5 * relative_covariance(&mut chain, 3, 68).unwrap().trace());
        constrained.optimise().unwrap();
        let after = relative_covariance(&mut constrained, 3, 68).unwrap();
        // The constraints have moved the poses by a little.
        assert!(
            (before - after).amax() < 0.05 * after.amax(),
            "{before} {after}"
        );
    }

    #[test]
    fn a_chain_is_known_before_anything_is_optimised() {
        let mut graph = drifting(10);
        let before = relative_covariance(&mut graph, 2, 9).unwrap();
        graph.optimise().unwrap();
        assert!(close_to(
            &before,
            &relative_covariance(&mut graph, 2, 9).unwrap()
        ));
        assert!(relative_covariance(&mut graph, 2, 11).is_err());
    }
}

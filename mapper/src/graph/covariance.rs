//! How well one node is known from another.

use super::system::System;
use super::{Edge, Error};
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// A node with the perturbation that it inherits from where its chain begins, and the noise gathered since.
struct Chained {
    /// The chain, newest node first; the last one is where it begins.
    nodes: Vec<usize>,
    /// For every node of the chain the covariance gathered from it to the newest one, in the newest one's frame.
    noise: Vec<Matrix3<f64>>,
}

/// Covariance of `j` seen from `i`, perturbations on the right.
pub(super) fn relative(
    system: Option<&mut System>,
    poses: &[Pose2],
    odometry: &[Edge],
    i: usize,
    j: usize,
) -> Result<Matrix3<f64>, Error> {
    for node in [i, j] {
        if node >= poses.len() {
            let count = poses.len();
            return Err(Error::NoNode { node, count });
        }
    }
    let not_connected = Error::NotConnected { from: i, to: j };
    let solved = system.as_ref().map_or(0, |system| system.nodes());
    let (from, to) = (
        chain(poses, odometry, solved, i),
        chain(poses, odometry, solved, j),
    );
    // d_j - Ad(T_ij^-1) d_i is the perturbation of T_ij.
    let seen_by = poses[i].between(&poses[j]).inverse().adjoint();
    let in_frame_of_j = |c: Matrix3<f64>| seen_by * c * seen_by.transpose();

    // What both have in common cancels.
    let common = from.nodes.iter().enumerate().find_map(|(at, node)| {
        let there = to.nodes.iter().position(|other| other == node)?;
        Some((at, there))
    });
    if let Some((at, there)) = common {
        return Ok(in_frame_of_j(from.noise[at]) + to.noise[there]);
    }
    let (Some(&a), Some(&b), Some(system)) = (from.nodes.last(), to.nodes.last(), system) else {
        return Err(not_connected);
    };
    if a >= solved || b >= solved || !system.joined(a, b) {
        return Err(not_connected);
    }
    let [aa, ab, bb] = system.marginals(a, b);
    let carried = |base: usize, node: usize| poses[base].between(&poses[node]).inverse().adjoint();
    let (to_i, to_j) = (carried(a, i), carried(b, j));
    let (by_i, by_j) = (seen_by * to_i, to_j);
    let cross = by_j * ab.transpose() * by_i.transpose();
    let base =
        by_i * aa * by_i.transpose() + by_j * bb * by_j.transpose() - cross - cross.transpose();
    let noise = |chained: &Chained| chained.noise.last().copied().unwrap_or_default();
    Ok(base + in_frame_of_j(noise(&from)) + noise(&to))
}

/// Follows odometry back from a node to one that the last optimisation knew.
fn chain(poses: &[Pose2], odometry: &[Edge], solved: usize, node: usize) -> Chained {
    let mut chained = Chained {
        nodes: vec![node],
        noise: vec![Matrix3::zeros()],
    };
    let mut noise = Matrix3::zeros();
    let mut at = node;
    // Nodes come in order: the edges that lead to the newest stand at the end.
    for edge in odometry.iter().rev() {
        if at < solved {
            break;
        }
        if edge.to != at || edge.from >= at {
            continue;
        }
        let Some(covariance) = edge.information.try_inverse() else {
            break;
        };
        let carry = poses[at].between(&poses[node]).inverse().adjoint();
        noise += carry * covariance * carry.transpose();
        at = edge.from;
        chained.nodes.push(at);
        chained.noise.push(noise);
    }
    chained
}

#[cfg(test)]
mod tests {
    use super::super::edge::moved;
    use super::super::testing::{close, drifting, edge};
    use super::*;
    use nalgebra::SMatrix;

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
                edge.error(&poses[edge.from], &poses[edge.to])
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
            let found = graph.relative_covariance(i, j).unwrap();
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
            .unwrap();
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
        let before = pairs.map(|(i, j)| graph.relative_covariance(i, j).unwrap());
        // New nodes that no loop holds move nothing: what was carried on is what the optimum says.
        graph.optimise_trusting().unwrap();
        for ((i, j), before) in pairs.into_iter().zip(before) {
            let after = graph.relative_covariance(i, j).unwrap();
            assert!(
                i == j || close_to(&before, &after),
                "{i} {j}: {before} {after}"
            );
            assert!(i != j || before.amax() < 1e-12);
        }
    }

    #[test]
    fn a_chain_is_known_before_anything_is_optimised() {
        let mut graph = drifting(10);
        let before = graph.relative_covariance(2, 9).unwrap();
        graph.optimise().unwrap();
        assert!(close_to(&before, &graph.relative_covariance(2, 9).unwrap()));
        assert!(graph.relative_covariance(2, 11).is_err());
    }
}

//! A start that hangs on no drift: chordal relaxation (Carlone et al., "Initialization techniques
//! for 3D SLAM", 2015).
//!
//! Gauss-Newton ends in the minimum nearest to where it began, and odometry that has turned too
//! far over a long way begins near another one. As vectors of the plane, of any length, headings
//! are linear, and so are positions once headings are known: two solutions of the same sparse
//! equations, from wherever the poses are.

use super::Error;
use super::edge::Edge;
use super::solver::{Term, fitting};
use super::system::System;
use nalgebra::{Matrix3, Vector3};
use randt_geometry::{Pose2, elementary::atan2};

/// An edge as a linear equation: x_to = `turn` x_from + `offset`. Of a node's three unknowns the
/// third is always zero: the equations are those of the poses.
struct Equation {
    turn: Matrix3<f64>,
    offset: Vector3<f64>,
    information: Matrix3<f64>,
}

/// Poses to start from. Losses play no part, and what is no unknown stays where it is.
pub(super) fn chordal(
    system: &mut Option<System>,
    poses: &[Pose2],
    terms: &[Term<'_>],
) -> Result<Vec<Pose2>, Error> {
    let system = fitting(system, poses.len(), terms)?;
    let vectors = poses
        .iter()
        .map(|pose| heading(pose).column(0).into_owned());
    let headings = least_squares(system, vectors.collect(), terms, |edge| Equation {
        turn: heading(&edge.measured),
        offset: Vector3::zeros(),
        information: Matrix3::identity() * edge.information.m33,
    })?;
    let turned = poses.iter().zip(&headings);
    let turned = turned.map(|(pose, v)| Pose2::new(pose.x_m, pose.y_m, atan2(v.y, v.x)));
    let turned: Vec<Pose2> = turned.collect();
    let positions = turned.iter().map(|pose| pose.translation().push(0.0));
    let positions = least_squares(system, positions.collect(), terms, |edge| {
        let there = turned[edge.from.0].compose(&edge.measured);
        let mut known = edge.information;
        for unknown in 0..2 {
            known[(unknown, 2)] = 0.0;
            known[(2, unknown)] = 0.0;
        }
        let turn = heading(&there);
        Equation {
            turn: Matrix3::identity(),
            offset: (there.translation() - turned[edge.from.0].translation()).push(0.0),
            information: turn * known * turn.transpose(),
        }
    })?;
    let found = turned.iter().zip(&positions);
    Ok(found
        .map(|(pose, at)| Pose2::new(at.x, at.y, pose.yaw_rad))
        .collect())
}

/// Minimises the equations' squared errors; anchors keep their values.
fn least_squares(
    system: &mut System,
    mut values: Vec<Vector3<f64>>,
    terms: &[Term<'_>],
    equation: impl Fn(&Edge) -> Equation,
) -> Result<Vec<Vector3<f64>>, Error> {
    system.clear();
    for (index, (edge, _)) in terms.iter().enumerate() {
        let Equation {
            turn,
            offset,
            information,
        } = equation(edge);
        let error = values[edge.to.0] - turn * values[edge.from.0] - offset;
        let derivatives = [-turn, Matrix3::identity()];
        system.add(index, &error, &derivatives, &information);
    }
    let is_solved = system.factorise(0.0);
    // It is not the factor of the poses' equations.
    system.factorised = false;
    if !is_solved {
        return Err(Error::Singular {
            unknowns: system.unknowns(),
            damping: 0.0,
        });
    }
    let step = system.step();
    for (node, value) in values.iter_mut().enumerate() {
        if let Some(own) = system.node_step(&step, node) {
            *value += Vector3::from(own);
        }
    }
    Ok(values)
}

/// The rotation by a pose's heading.
fn heading(pose: &Pose2) -> Matrix3<f64> {
    let (cos, sin) = pose.cos_sin();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::PoseGraph;
    use super::super::loss::Loss;
    use super::super::solver::{Effort, Start, solve};
    use super::super::testing::{close, drifting, edge, error_m, square};
    use super::*;

    /// Laps whose odometry turns by up to half a radian too far at every step, to either side, with
    /// true loops from each lap to the next.
    fn wound() -> PoseGraph {
        let mut graph = PoseGraph::default();
        graph.add_node(square(0)).unwrap();
        for step in 1..=400 {
            let measured = square(step - 1).between(&square(step));
            let yaw_rad = (step * step * 7919 % 1009) as f64 / 1009.0 - 0.5;
            let turned = measured.compose(&Pose2::new(0.0, 0.0, yaw_rad));
            let mut edge = edge(step - 1, step, turned);
            edge.information *= 0.01;
            graph.append(edge).unwrap();
        }
        close(&mut graph, 10);
        graph
    }

    /// Its edges, all believed.
    fn all(graph: &PoseGraph) -> Vec<Term<'_>> {
        let edges = graph.odometry().iter();
        let edges = edges.chain(graph.loops().iter().map(|l| &l.edge));
        edges.map(|edge| (edge, Loss::QUADRATIC)).collect()
    }

    #[test]
    fn what_contradicts_nothing_is_found_exactly_from_anywhere() {
        let mut graph = PoseGraph::default();
        for step in 0..80 {
            // Nowhere near, and headings all over the circle.
            let anywhere = Pose2::new((step * 37 % 50) as f64, -7.0, step as f64);
            let first = if step == 0 { square(0) } else { anywhere };
            graph.add_node(first).unwrap();
        }
        for step in 1..80 {
            let measured = square(step - 1).between(&square(step));
            graph.add_odometry(edge(step - 1, step, measured)).unwrap();
        }
        close(&mut graph, 7);
        let found = chordal(&mut None, graph.poses(), &all(&graph)).unwrap();
        for (step, pose) in found.iter().enumerate() {
            let off = square(step).between(pose);
            assert!(off.translation().norm() < 1e-9 && off.yaw_rad.abs() < 1e-9);
        }
    }

    #[test]
    fn a_drive_wound_up_by_its_odometry_is_unwound() {
        let mut graph = wound();
        let mut poses = graph.poses().to_vec();
        let stuck = solve(&mut None, &mut poses, &all(&graph), Effort::FULL).unwrap();
        let report = graph.optimise_trusting().unwrap();
        println!("{stuck:?}, {report:?}");
        assert_eq!(report.start, Start::Chordal);
        assert!(report.converged && stuck.chi2 > 4.0 * report.chi2);
        // Odometry is no better than that.
        assert!(error_m(&graph) < 2.5, "{}", error_m(&graph));
    }

    #[test]
    fn a_good_start_is_kept() {
        let mut graph = drifting(120);
        close(&mut graph, 3);
        // A component of one node is its own anchor.
        let other = graph.add_node(Pose2::new(50.0, 0.0, 1.0)).unwrap();
        let mut poses = graph.poses().to_vec();
        solve(&mut None, &mut poses, &all(&graph), Effort::FULL).unwrap();
        let report = graph.optimise_trusting().unwrap();
        assert_eq!(report.start, Start::Estimate);
        assert_eq!(graph.poses(), poses, "to the bit");
        assert_eq!(graph.poses()[other.0], Pose2::new(50.0, 0.0, 1.0));
    }
}

//! `cargo bench -p randt-mapper`: what the pose graph costs.
//!
//! Prints machine, data, median and p99: one more loop in a graph of 1,000 keyframes that is
//! solved already, the re-check of 400 good loops, and the whole of M3500 from its odometry.

mod shared;

use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_mapper::KeyframeIdx;
use randt_mapper::pose_graph::{Edge, PoseGraph};
use shared::{machine, print};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Keyframes of the warm graph.
const KEYFRAMES: usize = 1000;
/// Keyframes of a lap; every second one closes a loop with the lap before.
const LAP: usize = 100;
/// Keyframes of a submap: each is held by the first one, and loops lead there.
const SUBMAP: usize = 30;
/// Loops that come one by one.
const WARM_RUNS: usize = 400;
/// Keyframes and loops of the graph that is judged as a whole.
const JUDGED: (usize, usize) = (700, 400);
/// How often it is judged.
const JUDGED_RUNS: usize = 20;
/// Whole solutions of M3500.
const WHOLE_RUNS: usize = 50;

fn main() -> Result<(), Box<dyn Error>> {
    println!("machine: {}", machine());
    warm()?;
    judged()?;
    match data().map(|data| data.join("posegraph/M3500.g2o")) {
        Some(file) if file.exists() => whole(&file)?,
        _ => println!("M3500: skipped, no data (RANDT_DATA)"),
    }
    Ok(())
}

/// Where a drive on a circle is, a metre a keyframe.
fn circle(step: usize) -> Pose2 {
    let turn = core::f64::consts::TAU / LAP as f64;
    (0..step % LAP).fold(Pose2::IDENTITY, |pose, _| {
        pose.compose(&Pose2::new(1.0, 0.0, turn))
    })
}

/// A measurement that is off by a centimetre and a tenth of a degree, never twice the same.
fn measured(from: usize, to: usize, turn: usize) -> Edge {
    let (a, b) = (
        (turn * 7919 % 21) as f64 - 10.0,
        (turn * 104_729 % 21) as f64 - 10.0,
    );
    let error = Pose2::new(1e-3 * a, 1e-3 * b, 2e-4 * a);
    Edge {
        from: KeyframeIdx(from),
        to: KeyframeIdx(to),
        measured: circle(from).between(&circle(to)).compose(&error),
        information: Matrix3::from_diagonal(&[1e4, 1e4, 3e5].into()),
    }
}

/// A drive as the mapper adds it: a chain, and every keyframe held by the root of its submap.
fn drive(keyframes: usize) -> Result<PoseGraph, Box<dyn Error>> {
    let mut graph = PoseGraph::default();
    graph.add_node(Pose2::IDENTITY)?;
    for node in 1..keyframes {
        graph.append(measured(node - 1, node, node))?;
        let root = root(node);
        if root + 1 < node {
            graph.add_odometry(measured(root, node, node + 1))?;
        }
    }
    Ok(graph)
}

/// The root of a keyframe's submap.
fn root(node: usize) -> usize {
    node / SUBMAP * SUBMAP
}

fn warm() -> Result<(), Box<dyn Error>> {
    let mut graph = drive(KEYFRAMES)?;
    for node in (LAP..KEYFRAMES).step_by(2) {
        graph.add_loop(measured(root(node - LAP), node, node))?;
    }
    graph.optimise_trusting()?;
    let mut times = Vec::new();
    let mut iterations = 0;
    for run in 0..WARM_RUNS {
        let old = run * 37 % (KEYFRAMES - 2 * LAP);
        // The graph stays as large as it was.
        let id = graph.add_loop(measured(root(old), old + LAP + run % 5, run))?;
        let begin = Instant::now();
        let report = graph.optimise()?;
        times.push(begin.elapsed());
        assert!(report.converged, "{report:?}");
        iterations += report.iterations;
        graph.remove_loop(id);
    }
    print("one more loop, 1,000 keyframes", times, None);
    println!(
        "  {:.1} iterations each",
        iterations as f64 / WARM_RUNS as f64
    );
    Ok(())
}

fn judged() -> Result<(), Box<dyn Error>> {
    let (keyframes, loops) = JUDGED;
    let mut times = Vec::new();
    for _ in 0..JUDGED_RUNS {
        let mut graph = drive(keyframes)?;
        for l in 0..loops {
            let node = LAP + l * (keyframes - LAP) / loops;
            graph.add_loop(measured(root(node - LAP), node, l))?;
        }
        let begin = Instant::now();
        let recheck = graph.recheck()?;
        times.push(begin.elapsed());
        assert_eq!(recheck.on, loops, "{recheck:?}");
    }
    print("re-check, 700 keyframes, 400 loops", times, None);
    Ok(())
}

fn whole(file: &Path) -> Result<(), Box<dyn Error>> {
    let read = randt_readers::g2o::read(file)?;
    let mut times = Vec::new();
    for _ in 0..WHOLE_RUNS {
        let mut graph = PoseGraph::default();
        graph.add_node(Pose2::IDENTITY)?;
        let (mut odometry, mut loops) = (Vec::new(), Vec::new());
        for edge in &read.edges {
            let list = if edge.to == edge.from + 1 {
                &mut odometry
            } else {
                &mut loops
            };
            list.push(Edge {
                from: KeyframeIdx(usize::try_from(edge.from)?),
                to: KeyframeIdx(usize::try_from(edge.to)?),
                measured: edge.measured,
                information: Matrix3::from_row_slice(&edge.information.concat()),
            });
        }
        odometry.sort_by_key(|edge| edge.to);
        for edge in odometry {
            graph.append(edge)?;
        }
        for edge in loops {
            graph.add_loop(edge)?;
        }
        let begin = Instant::now();
        let report = graph.optimise_trusting()?;
        times.push(begin.elapsed());
        assert!(report.converged, "{report:?}");
    }
    print("M3500 from odometry", times, None);
    Ok(())
}

fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    std::env::var_os("RANDT_DATA")
        .map(PathBuf::from)
        .or(Some(beside))
        .filter(|path| path.is_dir())
}

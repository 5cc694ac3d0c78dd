//! `randt-lab graph`: solves a pose graph of others' making, as it is or with false loops among
//! the true ones.
//!
//! Responsible for what is printed. The graph and what is false in it are made by `problem` and
//! `false_loops`; the solver is the mapper's.

mod false_loops;
mod problem;

use anyhow::{Context, ensure};
use false_loops::FalseLoops;
use problem::Problem;
use randt::exit::Outcome;
use randt::output::print_value;
use randt_evaluation::{Trajectory, evaluate};
use randt_mapper::KeyframeIdx;
use randt_mapper::pose_graph::{PoseGraph, Start};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `randt-lab graph`.
///
/// Poses are forgotten but for the first: the start is odometry alone (edges from one id to the
/// next), or the chordal relaxation of all edges where that ends in a lower minimum. Without false
/// loops every edge is believed, as the published optima do. Exit code 3: no minimum was reached.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A planar pose graph in g2o's format (VERTEX_SE2, EDGE_SE2)
    #[arg(value_name = "FILE.g2o")]
    file: PathBuf,
    /// Add false loops, percent of the loops that the file has: random pairs of nodes, random
    /// relative poses
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u32).range(1..=200), conflicts_with = "false_groups")]
    false_loops: Option<u32>,
    /// Add G groups of N false loops that agree with each other: a part of the map shifted, or
    /// (every second one) turned by half a turn
    #[arg(long, value_name = "G,N", value_parser = false_loops::group_sizes)]
    false_groups: Option<(usize, usize)>,
    /// Seed of the false loops
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The figures under the names that other programs read.
#[derive(Debug, Serialize)]
struct Figures {
    poses: usize,
    edges: usize,
    loops: usize,
    start: &'static str,
    iterations: usize,
    time_ms: f64,
    chi2: f64,
    converged: bool,
    #[serde(flatten)]
    trial: Option<Trial>,
}

/// What the false loops did.
#[derive(Debug, Serialize)]
struct Trial {
    seed: u64,
    false_loops: usize,
    false_kept: usize,
    true_dropped: usize,
    /// Against the optimum without false loops.
    ate_m: f64,
    recheck_ms: f64,
    recheck_converged: bool,
}

/// Reads, solves, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let graph = randt_readers::g2o::read(&arguments.file)?;
    let file = arguments.file.display().to_string();
    let problem = Problem::new(&graph).with_context(|| file.clone())?;
    let mut clean = problem.graph().with_context(|| file.clone())?;
    let begin = Instant::now();
    let report = clean.optimise_trusting().with_context(|| file.clone())?;
    let time_ms = begin.elapsed().as_secs_f64() * 1e3;
    let kind = match (arguments.false_loops, arguments.false_groups) {
        (Some(percent), _) => Some(FalseLoops::Random { percent }),
        (_, Some((groups, size))) => Some(FalseLoops::Groups { groups, size }),
        _ => None,
    };
    let trial = kind.map(|kind| trial(&problem, &clean, &kind, arguments.seed));
    let figures = Figures {
        poses: clean.poses().len(),
        edges: clean.odometry().len() + clean.loops().len(),
        loops: clean.loops().len(),
        start: match report.start {
            Start::Estimate => "odometry",
            Start::Chordal => "chordal",
        },
        iterations: report.iterations,
        time_ms,
        chi2: report.chi2,
        converged: report.converged,
        trial: trial.transpose().with_context(|| file)?,
    };
    print_value(arguments.json, &figures, || table(&figures))?;
    let rechecked = figures.trial.as_ref().map(|trial| trial.recheck_converged);
    if figures.converged && rechecked != Some(false) {
        return Ok(Outcome::Good);
    }
    let which = match figures.converged {
        true => "the graph with false loops",
        false => "the graph",
    };
    eprintln!(
        "note: {which} is not converged: no step lowers its cost further, or the steps ran out, \
         and that is no minimum for sure"
    );
    Ok(Outcome::DataLost)
}

/// Solves again with false loops among the others.
fn trial(
    problem: &Problem,
    clean: &PoseGraph,
    kind: &FalseLoops,
    seed: u64,
) -> anyhow::Result<Trial> {
    let wrong = kind.draw(clean, seed)?;
    let mut graph = problem.graph()?;
    // Names rise with the order of adding: the true ones come first.
    let first_false = graph.loops().len();
    for edge in &wrong {
        graph.add_loop(edge.clone())?;
    }
    let begin = Instant::now();
    let recheck = graph.recheck()?;
    let recheck_ms = begin.elapsed().as_secs_f64() * 1e3;
    let (right, kept) = graph.loops().split_at(first_false);
    Ok(Trial {
        seed,
        false_loops: wrong.len(),
        false_kept: kept.iter().filter(|l| l.on).count(),
        true_dropped: right.iter().filter(|l| !l.on).count(),
        ate_m: ate_m(&graph, clean)?,
        recheck_ms,
        recheck_converged: recheck.report.converged,
    })
}

/// Root mean square of the positions' differences after rigid alignment, m; every component by
/// itself.
fn ate_m(graph: &PoseGraph, clean: &PoseGraph) -> anyhow::Result<f64> {
    let trajectory = |graph: &PoseGraph| {
        let mut trajectory = Trajectory::unstamped();
        for (node, pose) in graph.poses().iter().enumerate() {
            let component = clean.component_of(KeyframeIdx(node)).unwrap_or_default();
            trajectory.push(0, component.0 as u64, *pose);
        }
        trajectory
    };
    let evaluation = evaluate(&trajectory(graph), &trajectory(clean))?;
    let ate_m = evaluation.ate_rmse_m;
    ensure!(
        ate_m.is_some(),
        "no component has the three poses that an error needs"
    );
    Ok(ate_m.unwrap_or_default())
}

/// The figures for people.
fn table(figures: &Figures) -> String {
    let mut text = format!(
        "{} poses, {} edges, {} of them loops\n\
         optimum: chi2 {:.6} after {} iterations from {}, {:.1} ms{}\n",
        figures.poses,
        figures.edges,
        figures.loops,
        figures.chi2,
        figures.iterations,
        match figures.start {
            "chordal" => "a chordal start",
            start => start,
        },
        figures.time_ms,
        if figures.converged {
            ""
        } else {
            ", NOT converged"
        }
    );
    if let Some(trial) = &figures.trial {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "with {} false loops (seed {}): ATE {:.4} m, {} false loops kept, {} true loops dropped, {:.0} ms",
            trial.false_loops,
            trial.seed,
            trial.ate_m,
            trial.false_kept,
            trial.true_dropped,
            trial.recheck_ms
        );
    }
    text
}

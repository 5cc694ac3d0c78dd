//! Loops that are false, drawn from a seed.

use anyhow::{bail, ensure};
use randt_geometry::Pose2;
use randt_geometry::elementary::{PI, sin_cos};
use randt_mapper::KeyframeIdx;
use randt_mapper::pose_graph::{Edge, PoseGraph};
use randt_simulator::Random;

/// A loop is false when it is off by more than this, m and rad: what a grid to navigate by does
/// not forgive.
const FALSE_M: f64 = 0.5;
const FALSE_RAD: f64 = 5.0 * PI / 180.0;
/// A group's runs lie on each other within this, m and rad, as a place that looks like another
/// does.
const GROUP_OFFSET_M: f64 = 1.0;
const GROUP_OFFSET_RAD: f64 = 0.2;
/// Draws per loop or group: in a map of one place there may be none that is false.
const DRAWS_MAX: usize = 1000;
/// Streams of a seed.
const RANDOM_STREAM: u64 = 1;
const GROUP_STREAM: u64 = 2;

/// What is false.
pub(super) enum FalseLoops {
    /// Random pairs of nodes with random relative poses, percent of the true loops.
    Random {
        /// Percent.
        percent: u32,
    },
    /// Groups that agree with each other.
    Groups {
        /// How many.
        groups: usize,
        /// Loops in each.
        size: usize,
    },
}

/// `G,N`.
pub(super) fn group_sizes(text: &str) -> Result<(usize, usize), String> {
    let parse = |word: &str| {
        word.parse::<usize>()
            .ok()
            .filter(|n| (1..=1000).contains(n))
    };
    let (groups, size) = text
        .split_once(',')
        .ok_or("expected G,N: groups and their size")?;
    match (parse(groups), parse(size)) {
        (Some(groups), Some(size)) => Ok((groups, size)),
        _ => Err("expected two whole numbers from 1 to 1000: G,N".to_owned()),
    }
}

impl FalseLoops {
    /// Draws loops that are false in a graph that is solved. Each claims the information of some
    /// true loop.
    pub fn draw(&self, clean: &PoseGraph, seed: u64) -> anyhow::Result<Vec<Edge>> {
        ensure!(
            !clean.loops().is_empty(),
            "no loops in it that false ones could be among"
        );
        match *self {
            Self::Random { percent } => {
                let count = (clean.loops().len() * percent as usize).div_ceil(100);
                let mut random = Random::new(seed, RANDOM_STREAM);
                (0..count)
                    .map(|_| random_loop(clean, &mut random))
                    .collect()
            }
            Self::Groups { groups, size } => {
                let mut random = Random::new(seed, GROUP_STREAM);
                let groups = (0..groups).map(|n| group(clean, size, n % 2 == 1, &mut random));
                Ok(groups.collect::<anyhow::Result<Vec<_>>>()?.concat())
            }
        }
    }
}

/// A random pair, seen from within the reach of the true loops.
fn random_loop(clean: &PoseGraph, random: &mut Random) -> anyhow::Result<Edge> {
    let measured = clean
        .loops()
        .iter()
        .map(|l| l.edge.measured.translation().norm());
    let reach_m = measured.fold(1.0, f64::max);
    for _ in 0..DRAWS_MAX {
        let (from, to) = (
            below(random, clean.poses().len()),
            below(random, clean.poses().len()),
        );
        let measured = within(random, reach_m, PI);
        if from.abs_diff(to) > 1 && is_false(clean, from, to, &measured) {
            return Ok(with_information(clean, from, to, measured, random));
        }
    }
    bail!("no false loop found in {DRAWS_MAX} draws: the map is too small");
}

/// Two runs of nodes; the second is laid onto the first by one wrong rigid motion.
fn group(
    clean: &PoseGraph,
    size: usize,
    turned: bool,
    random: &mut Random,
) -> anyhow::Result<Vec<Edge>> {
    let poses = clean.poses();
    ensure!(
        poses.len() > 4 * size,
        "{} poses are too few for groups of {size}",
        poses.len()
    );
    for _ in 0..DRAWS_MAX {
        let starts = poses.len() - size + 1;
        let (a, b) = (below(random, starts), below(random, starts));
        let offset = within(random, GROUP_OFFSET_M, GROUP_OFFSET_RAD);
        let turn = Pose2::new(0.0, 0.0, if turned { PI } else { 0.0 });
        // Turned runs are passed the other way round.
        let there = |k: usize| if turned { b + size - 1 - k } else { b + k };
        let wrong = poses[a]
            .compose(&turn)
            .compose(&offset)
            .compose(&poses[there(0)].inverse());
        let pairs = (0..size).map(|k| {
            let moved = wrong.compose(&poses[there(k)]);
            (a + k, there(k), poses[a + k].between(&moved))
        });
        let pairs: Vec<_> = pairs.collect();
        if a.abs_diff(b) > 2 * size && pairs.iter().all(|(i, j, z)| is_false(clean, *i, *j, z)) {
            let edges = pairs
                .into_iter()
                .map(|(i, j, z)| with_information(clean, i, j, z, random));
            return Ok(edges.collect());
        }
    }
    bail!("no group of {size} false loops found in {DRAWS_MAX} draws: the map is too small");
}

fn is_false(clean: &PoseGraph, from: usize, to: usize, measured: &Pose2) -> bool {
    let error = clean.poses()[from]
        .between(&clean.poses()[to])
        .between(measured);
    error.translation().norm() > FALSE_M || error.yaw_rad.abs() > FALSE_RAD
}

fn with_information(
    clean: &PoseGraph,
    from: usize,
    to: usize,
    measured: Pose2,
    random: &mut Random,
) -> Edge {
    let like = &clean.loops()[below(random, clean.loops().len())].edge;
    Edge {
        from: KeyframeIdx(from),
        to: KeyframeIdx(to),
        measured,
        information: like.information,
    }
}

/// A pose evenly in a disc, and in a range of headings to both sides.
fn within(random: &mut Random, radius_m: f64, turn_rad: f64) -> Pose2 {
    let distance_m = radius_m * random.unit().sqrt();
    let (sin, cos) = sin_cos(random.between(-PI, PI));
    Pose2::new(
        distance_m * cos,
        distance_m * sin,
        random.between(-turn_rad, turn_rad),
    )
}

fn below(random: &mut Random, count: usize) -> usize {
    // unit() is below 1, and counts are far below 2^53.
    (random.unit() * count as f64) as usize
}

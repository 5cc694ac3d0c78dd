//! Whether the map's covariances are those of its errors.

use randt_evaluation::{MotionErrors, Trajectory};
use randt_mapper::{KeyframeIdx, Mapper};
use randt_simulator::Random;

/// Pairs of keyframes that are drawn.
const PAIRS: usize = 200;
/// The pairs are the same in every run.
const SEED: u64 = 1;
const STREAM: u64 = 3;

/// Normalised errors of keyframes at the drive's end, seen from other ones.
#[derive(Debug, Default)]
pub(super) struct MapErrors {
    /// Of all nodes of the first component, seen from its first one.
    pub first: NormalizedErrors,
    /// Of random pairs of them.
    pub pairs: NormalizedErrors,
}

/// Means of some errors; none where there are none.
#[derive(Debug, Default)]
pub(super) struct NormalizedErrors {
    /// Error squared over its covariance; 3 where that is right.
    pub nees: Option<f64>,
    /// Share inside 95 %.
    pub inside: Option<f64>,
    /// Heading's error squared over its variance; 1 where that is right.
    pub yaw_nees: Option<f64>,
}

impl MapErrors {
    /// Of the map's nodes against the truth.
    pub fn new(mapper: &Mapper, truth: &Trajectory) -> Self {
        let first = KeyframeIdx(0);
        let count = mapper.poses().len();
        let nodes = (1..count).map(KeyframeIdx);
        let nodes = nodes.filter(|node| {
            mapper.is_node(*node) && mapper.component_of(*node) == mapper.component_of(first)
        });
        let nodes: Vec<KeyframeIdx> = nodes.collect();
        let mut random = Random::new(SEED, STREAM);
        // unit() is below 1.
        let mut drawn = || nodes.get((random.unit() * nodes.len() as f64) as usize);
        let pairs = (0..PAIRS).filter_map(|_| Some((*drawn()?, *drawn()?)));
        let pairs: Vec<_> = pairs.filter(|(a, b)| a != b).collect();
        let errors = MotionErrors::new(truth);
        Self {
            first: of_pairs(mapper, &errors, nodes.iter().map(|node| (first, *node))),
            pairs: of_pairs(mapper, &errors, pairs.into_iter()),
        }
    }
}

fn of_pairs(
    mapper: &Mapper,
    errors: &MotionErrors<'_>,
    pairs: impl Iterator<Item = (KeyframeIdx, KeyframeIdx)>,
) -> NormalizedErrors {
    let Some(marginals) = mapper.marginals() else {
        return NormalizedErrors::default();
    };
    let at = |node: KeyframeIdx| {
        let stamp_ns = mapper.keyframes().get(node.0)?.stamp_ns;
        Some((stamp_ns, *mapper.poses().get(node.0)?))
    };
    let found = pairs.filter_map(|(from, to)| {
        let error = errors.relative([at(from)?, at(to)?], marginals.relative(from, to)?)?;
        let yaw = error.error.z * error.error.z / error.covariance.m33;
        Some((error.nees()?, error.is_inside()?, yaw))
    });
    let found: Vec<(f64, bool, f64)> = found.collect();
    let mean = |value: fn(&(f64, bool, f64)) -> f64| {
        let sum: f64 = found.iter().map(value).sum();
        (!found.is_empty()).then(|| sum / found.len() as f64)
    };
    NormalizedErrors {
        nees: mean(|it| it.0),
        inside: mean(|it| f64::from(u8::from(it.1))),
        yaw_nees: mean(|it| it.2),
    }
}

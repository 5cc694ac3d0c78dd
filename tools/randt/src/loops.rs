//! The loops in `report.json`: every candidate, what it was judged by, and its status.

use randt_mapper::{CandidateOrigin, KeyframeIdx, LoopClosure, Mapper, Scores};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// All candidates and what became of them. Reports of earlier builds have other names for some of
/// it.
#[derive(Debug, Serialize, Deserialize)]
pub struct Loops {
    /// How many have which status.
    #[serde(default, alias = "fates")]
    pub statuses: BTreeMap<String, u64>,
    /// Components of the map that no loop connects: 1 where everything is connected.
    #[serde(default, alias = "parts")]
    pub components: usize,
    /// Each candidate, in the order in which they were found.
    pub candidates: Vec<Entry>,
}

/// One candidate. Its fields are those of the report; what was not measured is left out.
#[derive(Debug, Serialize, Deserialize)]
pub struct Entry {
    /// Stamp of the older keyframe.
    pub from_ns: i64,
    /// Stamp of the newer keyframe.
    pub to_ns: i64,
    /// Pose of the newer keyframe's `base_link` in the older one's: x m, y m, yaw rad.
    pub relative: [f64; 3],
    /// What became of it, and why.
    #[serde(alias = "fate")]
    pub status: Cow<'static, str>,
    /// `appearance` or `proximity`.
    #[serde(default, alias = "source")]
    pub origin: Cow<'static, str>,
    /// ScanContext distance with odometry's part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub appearance_distance: Option<f64>,
    /// Share of the newer surroundings that the older ones explain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward: Option<f64>,
    /// The other way round.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backward: Option<f64>,
    /// The best fit of another pose that the estimate leaves open.
    #[serde(alias = "flipped", skip_serializing_if = "Option::is_none")]
    pub rival: Option<f64>,
    /// The largest share that is explained where they are moved along their least certain
    /// direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub displaced: Option<f64>,
    /// Cauchy-Schwarz divergence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub divergence: Option<f64>,
    /// Standard deviation along the least certain direction, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// Squared deviation from the estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi2: Option<f64>,
    /// Standard deviation of the estimate before, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_sigma_m: Option<f64>,
}

impl Loops {
    /// What a mapper found.
    pub fn from_mapper(mapper: &Mapper) -> Self {
        let mut statuses = BTreeMap::new();
        for closure in mapper.closures() {
            let status = closure.status.name().to_owned();
            *statuses.entry(status).or_default() += 1;
        }
        let closures = mapper.closures().iter();
        Self {
            statuses,
            components: mapper.components(),
            candidates: closures.map(|closure| entry(mapper, closure)).collect(),
        }
    }
}

fn entry(mapper: &Mapper, closure: &LoopClosure) -> Entry {
    let stamp_ns = |index: KeyframeIdx| {
        let keyframe = mapper.keyframes().get(index.0);
        keyframe.map_or(0, |keyframe| keyframe.stamp_ns)
    };
    // Every score, so that the compiler refuses a report that lacks one.
    let Scores {
        forward,
        backward,
        rival,
        displaced,
        divergence,
        sigma_m,
        chi2,
        prior_sigma_m,
    } = closure.scores;
    Entry {
        from_ns: stamp_ns(closure.older),
        to_ns: stamp_ns(closure.newer),
        relative: closure.older_from_newer.to_array(),
        status: closure.status.name().into(),
        origin: closure.origin.name().into(),
        appearance_distance: match closure.origin {
            CandidateOrigin::Appearance { distance, .. } => Some(distance),
            CandidateOrigin::Proximity => None,
        },
        forward,
        backward,
        rival,
        displaced,
        divergence,
        sigma_m,
        chi2: chi2.filter(|chi2| chi2.is_finite()),
        prior_sigma_m,
    }
}

//! The loops in `report.json`: every candidate, what it was judged by, what became of it.

use randt_mapper::{Candidate, Mapper, Source};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// All candidates and their fates.
#[derive(Debug, Serialize, Deserialize)]
pub struct Loops {
    /// How many met which fate.
    #[serde(default)]
    pub fates: BTreeMap<String, u64>,
    /// Unjoined parts of the map: 1 where everything hangs together.
    #[serde(default)]
    pub parts: usize,
    /// Each candidate, in the order in which they were found.
    pub candidates: Vec<Entry>,
}

/// One candidate. What it did not come to be judged by is left out.
#[derive(Debug, Serialize, Deserialize)]
pub struct Entry {
    /// Stamp of the older keyframe.
    pub from_ns: i64,
    /// Stamp of the newer keyframe.
    pub to_ns: i64,
    /// Pose of the newer keyframe's `base_link` in the older one's: x m, y m, yaw rad.
    pub relative: [f64; 3],
    /// What became of it, and why.
    pub fate: Cow<'static, str>,
    /// `appearance` or `estimate`.
    #[serde(default)]
    pub source: Cow<'static, str>,
    /// ScanContext distance with odometry's part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub appearance_distance: Option<f64>,
    /// Share of the newer surroundings that the older ones explain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward: Option<f64>,
    /// The other way round.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backward: Option<f64>,
    /// The same under the opposite heading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flipped: Option<f64>,
    /// The largest share that is explained where they are moved along their least certain direction.
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
    pub fn of(mapper: &Mapper) -> Self {
        let mut fates = BTreeMap::new();
        for candidate in mapper.candidates() {
            *fates.entry(candidate.fate.name().to_owned()).or_default() += 1;
        }
        let count = mapper.places().len();
        Self {
            fates,
            parts: (0..count)
                .filter(|place| mapper.part_of(*place) == *place)
                .count(),
            candidates: mapper
                .candidates()
                .iter()
                .map(|c| entry(mapper, c))
                .collect(),
        }
    }
}

fn entry(mapper: &Mapper, candidate: &Candidate) -> Entry {
    let stamp = |place: usize| mapper.places().get(place).map_or(0, |place| place.stamp_ns);
    let scores = &candidate.scores;
    let (source, appearance_distance) = match candidate.source {
        Source::Appearance { distance, .. } => ("appearance", Some(distance)),
        Source::Estimate => ("estimate", None),
    };
    Entry {
        from_ns: stamp(candidate.from),
        to_ns: stamp(candidate.to),
        relative: candidate.relative.to_array(),
        fate: candidate.fate.name().into(),
        source: source.into(),
        appearance_distance,
        forward: scores.forward,
        backward: scores.backward,
        flipped: scores.flipped,
        displaced: scores.displaced,
        divergence: scores.divergence,
        sigma_m: scores.sigma_m,
        chi2: scores.chi2.filter(|chi2| chi2.is_finite()),
        prior_sigma_m: scores.prior_sigma_m,
    }
}

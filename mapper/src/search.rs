//! Where a keyframe could have been before: leads from what it looks like and from where it is believed to be.

use crate::{Place, RingKey, ScanContext};
use randt_config::{Config, Loops};
use randt_geometry::elementary::exp;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;

/// Leads that are followed from each source; each costs a registration.
const LEADS_MAX: usize = 3;

/// Where a lead comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Source {
    /// The places look alike under this turn.
    Appearance {
        /// ScanContext distance, with odometry's part.
        distance: f64,
        /// Heading of the newest place in the frame of the old one, rad.
        yaw_rad: f64,
    },
    /// The estimate says that the robot is there again.
    Estimate,
}

/// An old place that the newest one may be at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Index of the old place.
    pub place: usize,
    /// Why.
    pub source: Source,
}

/// The descriptors of all places, and their keys.
#[derive(Clone, Debug)]
pub struct Search {
    config: Loops,
    apart_m: f64,
    keys: Vec<RingKey>,
    /// Of a place that was recalled, from when its key made it one to be compared.
    contexts: Vec<OnceCell<ScanContext>>,
}

impl Search {
    /// None yet.
    pub fn new(config: &Config) -> Self {
        Self {
            config: config.loops.clone(),
            apart_m: config.map_reach_m(),
            keys: Vec::new(),
            contexts: Vec::new(),
        }
    }

    /// Takes the newest place.
    pub fn push(&mut self, place: &Place) {
        let (context, key) = ScanContext::new(&place.sight.points, &self.config);
        self.keys.push(key);
        self.contexts.push(context.into());
    }

    /// Takes the newest place, whose key is known.
    pub(crate) fn recall(&mut self, key: RingKey) {
        self.keys.push(key);
        self.contexts.push(OnceCell::new());
    }

    /// The keys of all places.
    pub(crate) fn keys(&self) -> &[RingKey] {
        &self.keys
    }

    fn context(&self, index: usize, places: &[Place]) -> Option<&ScanContext> {
        let (context, place) = (self.contexts.get(index)?, places.get(index)?);
        let made = || ScanContext::new(&place.sight.points, &self.config).0;
        Some(context.get_or_init(made))
    }

    /// Places so long ago that meeting them again is a loop: an earlier part of the path, or another frame.
    fn old<'a>(&self, places: &'a [Place]) -> impl Iterator<Item = (usize, &'a Place)> + use<'a> {
        let path_min_m = self.config.path_min_m;
        let newest = places.last();
        places.iter().enumerate().filter(move |(_, place)| {
            newest.is_some_and(|newest| {
                place.odom_frame_id != newest.odom_frame_id
                    || newest.path_m - place.path_m >= path_min_m
            })
        })
    }

    /// The places that look most like the newest one, best first, one of each neighbourhood.
    ///
    /// `deviations(place)`: how many standard deviations away from there odometry believes the robot to be, where it
    /// says anything. It adds 1 - exp(-d^2 / 2) to the distance (odometry similarity, as in TBV SLAM).
    pub fn look_alikes(
        &self,
        places: &[Place],
        mut deviations: impl FnMut(usize) -> Option<f64>,
    ) -> Vec<Lead> {
        let newest = self.keys.len().saturating_sub(1);
        let (Some(key), Some(context)) = (self.keys.last(), self.context(newest, places)) else {
            return Vec::new();
        };
        let mut sieve: Vec<(f32, usize)> = self
            .old(places)
            .filter_map(|(i, _)| Some((key.distance(self.keys.get(i)?), i)))
            .collect();
        let keep = self.config.candidates as usize;
        if sieve.len() > keep {
            sieve.select_nth_unstable_by(keep, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            sieve.truncate(keep);
        }
        let leads = sieve.iter().filter_map(|&(_, place)| {
            let likeness = self.context(place, places)?.compare(context);
            let odometry = deviations(place).map_or(0.0, |d| 1.0 - exp(-0.5 * d * d));
            let distance = likeness.distance + odometry;
            let source = Source::Appearance {
                distance,
                yaw_rad: likeness.yaw_rad,
            };
            Some((distance, Lead { place, source }))
        });
        self.best(places, leads.collect())
    }

    /// The old places nearest to the newest one, within `radius_m`, one of each neighbourhood. `away_m(place)`: how far
    /// off the estimate has a place, where it knows.
    pub fn neighbours(
        &self,
        places: &[Place],
        radius_m: f64,
        away_m: impl Fn(usize) -> Option<f64>,
    ) -> Vec<Lead> {
        let leads = self.old(places).filter_map(|(place, _)| {
            let source = Source::Estimate;
            Some((away_m(place)?, Lead { place, source }))
        });
        let near = leads.filter(|(away_m, _)| *away_m <= radius_m);
        self.best(places, near.collect())
    }

    /// The best leads, no two of them of one neighbourhood of the path.
    fn best(&self, places: &[Place], mut leads: Vec<(f64, Lead)>) -> Vec<Lead> {
        leads.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.place.cmp(&b.1.place)));
        let near = |a: &Lead, b: &Lead| match (places.get(a.place), places.get(b.place)) {
            (Some(a), Some(b)) => {
                a.odom_frame_id == b.odom_frame_id && (a.path_m - b.path_m).abs() < self.apart_m
            }
            _ => true,
        };
        let mut best: Vec<Lead> = Vec::new();
        for (_, lead) in leads {
            if best.len() < LEADS_MAX && !best.iter().any(|other| near(other, &lead)) {
                best.push(lead);
            }
        }
        best
    }
}

//! From leads to candidates: registration against the old place's submap, from every start that is possible.

use super::Mapper;
use crate::{
    Candidate, Fate,
    candidate::Scores,
    divergence::divergence,
    registration::Registration,
    search::{Lead, Source},
    verify::{Prior, deviation, judge},
};
use nalgebra::Matrix3;
use randt_geometry::{Pose2, elementary::PI};

/// Places are looked for within so many standard deviations of the estimate, and at least and at most so many metres.
const NEAR_DEVIATIONS: f64 = 3.0;
const NEAR_MIN_M: f64 = 2.0;
const NEAR_MAX_M: f64 = 8.0;
/// The estimate counts as no sharper than this for what looks alike, m.
const SIGMA_MIN_M: f64 = 0.1;
/// Below this the estimate is a better start than what a place looks like, rad: a sector.
const START_SIGMA_RAD: f64 = 0.1;
/// Headings within so many standard deviations, and one sector, of the estimate's are the same.
const HEADING_DEVIATIONS: f64 = 4.0;
/// Part of the sight in which the mixtures are compared: beyond it they were seen from too far apart.
const DIVERGENCE_SIGHT: f64 = 0.6;

impl Mapper {
    /// Searches for loops of the newest place and takes those that hold.
    pub(super) fn close_loops(&mut self) {
        let leads = self.leads();
        if leads.is_empty() {
            return;
        }
        self.trail.follow(&self.places);
        let mut tried: Vec<usize> = Vec::new();
        let first = self.candidates.len();
        for lead in leads {
            let Some(place) = self.places.get(lead.place) else {
                continue;
            };
            let Some(root) = self.submaps.root_of(place, &self.places) else {
                continue;
            };
            if !tried.contains(&root) {
                tried.push(root);
                if let Some(candidate) = self.follow(&lead, root) {
                    self.candidates.push(candidate);
                }
            }
        }
        self.confirm(first);
    }

    /// Leads from both sources.
    fn leads(&mut self) -> Vec<Lead> {
        let Some(newest) = self.places.len().checked_sub(1) else {
            return Vec::new();
        };
        if !self.config.loops.verify {
            let mut leads = self.search.look_alikes(&self.places, |_| None);
            leads.truncate(1);
            return leads;
        }
        // One covariance for all: that of the place against the start of its part.
        let part = self.part_of(newest);
        let prior = self.prior(part, newest);
        let sigma_m = prior.map_or(f64::INFINITY, |prior| prior.sigma_m());
        let graph = &self.graph;
        let away_m = |place: usize| {
            let (here, there) = (graph.poses().get(newest)?, graph.poses().get(place)?);
            let same = graph.component_of(place) == Some(part);
            same.then(|| (here.translation() - there.translation()).norm())
        };
        let mut leads = self.search.look_alikes(&self.places, |place| {
            let beyond_m = (away_m(place)? - NEAR_MIN_M).max(0.0);
            Some(beyond_m / sigma_m.max(SIGMA_MIN_M))
        });
        let radius_m = (NEAR_DEVIATIONS * sigma_m).clamp(NEAR_MIN_M, NEAR_MAX_M);
        leads.extend(self.search.neighbours(&self.places, radius_m, away_m));
        leads
    }

    /// What the graph says of `to` seen from `from`, where it joins them.
    pub(super) fn prior(&mut self, from: usize, to: usize) -> Option<Prior> {
        if self.graph.component_of(from) != self.graph.component_of(to) {
            return None;
        }
        let covariance = if from == to {
            Matrix3::zeros()
        } else {
            self.graph.relative_covariance(from, to).ok()?
        };
        let poses = self.graph.poses();
        let pose = poses.get(from)?.between(poses.get(to)?);
        Some(Prior { pose, covariance })
    }

    /// Registers the newest place to the submap of a lead and judges the result.
    fn follow(&mut self, lead: &Lead, root: usize) -> Option<Candidate> {
        let newest = self.places.len().checked_sub(1)?;
        let verify = self.config.loops.verify;
        let prior = self.prior(root, newest).filter(|_| verify);
        if lead.source == Source::Estimate && prior.is_none() {
            return None;
        }
        let starts = self.starts(lead, root, prior.as_ref());
        let mut candidate = self.measure(root, newest, &starts, lead.source);
        if let Some(prior) = prior {
            candidate.scores.prior_sigma_m = Some(prior.sigma_m());
            if starts.is_empty() {
                candidate.relative = prior.pose;
                candidate.fate = Fate::AgainstOdometry;
                return Some(candidate);
            }
            let covariance = candidate.information.try_inverse();
            candidate.scores.chi2 = covariance.map(|c| prior.chi2(&candidate.relative, &c));
        }
        if candidate.scores.forward.is_none() {
            return Some(candidate);
        }
        // Where odometry knows the heading, the opposite one is out of the question.
        if verify && prior.is_none_or(|prior| prior.sigma_rad() > START_SIGMA_RAD) {
            let pose = candidate.relative;
            let flipped = Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad + PI);
            let flipped = self.register(root, &[flipped]);
            candidate.scores.flipped = Some(flipped.map_or(0.0, |flipped| flipped.fit()));
        }
        candidate.fate = match judge(&candidate.scores, &self.config.loops) {
            Err(fate) if verify => fate,
            _ => Fate::Unconfirmed,
        };
        Some(candidate)
    }

    /// Registers the trail, which ends at `to`, to the submap of `from`; what is not measured stays open.
    pub(super) fn measure(
        &mut self,
        from: usize,
        to: usize,
        starts: &[Pose2],
        source: Source,
    ) -> Candidate {
        let mut candidate = Candidate {
            from,
            to,
            source,
            relative: Pose2::IDENTITY,
            information: Matrix3::zeros(),
            scores: Scores::default(),
            fate: Fate::Unregistered,
        };
        let Some(registration) = self.register(from, starts) else {
            return candidate;
        };
        candidate.relative = registration.pose;
        candidate.information = registration.information;
        let sight_m = DIVERGENCE_SIGHT * self.config.sight_m();
        let grid = self.submaps.grid(from, &self.places);
        candidate.scores = Scores {
            forward: Some(registration.forward),
            backward: Some(registration.backward),
            displaced: Some(registration.displaced),
            sigma_m: Some(registration.sigmas_m()[0]),
            divergence: grid
                .map(|grid| divergence(grid, &self.trail.grid, &registration.pose, sight_m)),
            ..Scores::default()
        };
        candidate
    }

    /// Where a registration may start: the estimate where it is sharp, else what the place looks like, where odometry
    /// allows that.
    fn starts(&self, lead: &Lead, root: usize, prior: Option<&Prior>) -> Vec<Pose2> {
        let mut starts = Vec::new();
        if let Some(prior) = prior {
            starts.push(prior.pose);
        }
        if let (Source::Appearance { yaw_rad, .. }, Some(place), Some(root)) = (
            lead.source,
            self.places.get(lead.place),
            self.places.get(root),
        ) {
            let look = root
                .odom
                .between(&place.odom)
                .compose(&Pose2::new(0.0, 0.0, yaw_rad));
            let Some(prior) = prior else {
                return vec![look];
            };
            let off = deviation(&prior.pose, &look);
            let sector = 2.0 * PI / f64::from(self.config.loops.sectors);
            let away_m = HEADING_DEVIATIONS * prior.sigma_m() + NEAR_MAX_M;
            if off.z.abs() > HEADING_DEVIATIONS * prior.sigma_rad() + 2.0 * sector
                || off.xy().norm() > away_m
            {
                return Vec::new();
            }
            if prior.sigma_m() > 0.5 * self.config.cell_size_m() {
                starts.push(look);
            }
        }
        starts
    }

    /// The best of several registrations to one submap.
    fn register(&mut self, root: usize, starts: &[Pose2]) -> Option<Registration> {
        let grid = self.submaps.grid(root, &self.places)?;
        let (registrar, trail) = (&mut self.registrar, &self.trail);
        starts
            .iter()
            .filter_map(|start| registrar.register(grid, trail, start))
            .max_by(|a, b| a.fit().total_cmp(&b.fit()))
    }
}

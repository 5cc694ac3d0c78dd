//! Joins unconnected parts of the map.
//!
//! A part has no prior against another: rooms and corridors that look alike give loops that agree with one another for
//! as long as the robot drives among them. So a part is joined by the whole of its drive, not by single loops: laid
//! over the other part it must fit wherever the robot was there before, over a long way, and in no other position.

use super::Mapper;
use crate::{
    Candidate, Fate,
    search::Source,
    verify::{deviation, is_alike, is_fixed},
};
use randt_geometry::Pose2;

/// A part is tried again after so many keyframe distances of path.
const EVERY_KEYFRAMES: f64 = 8.0;
/// Submaps that must fit, two metres of path each indoors: fewer say too little together.
const FITS_MIN: usize = 16;
/// Share of their cells that the other part must explain, on the average. In eight drives through a building whose halves
/// and rooms look alike, true positions have 0.76 to 0.87 and false ones, of up to 44 fits, 0.54 to 0.71.
const EXPLAINED_MIN: f64 = 0.74;
/// Of the submaps that lie where the robot was before, this share may not fit: doors move, and odometry bends.
const MISFITS_MAX: f64 = 0.1;
/// Another position of as good fits, this share of the best one's in number, makes both doubtful.
const RIVAL_SHARE: f64 = 0.5;
/// Positions tried, by the number of loops that speak for them.
const POSITIONS_MAX: usize = 5;
/// Positions within these are one, m and rad: odometry's drift over a part.
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.1;
/// A submap is compared where the other part has a place within so many keyframe distances.
const NEAR_KEYFRAMES: f64 = 3.0;
/// A fit may end this far from where the position has it, m and rad: within [`SAME_M`] for the drift of long parts.
const OFF_MAX_M: f64 = 1.0;
const OFF_MAX_RAD: f64 = 0.08;

/// Where the robot can have come to while nothing was seen: so many times its fastest speed so far, and a little, m.
const REACH_SPEEDS: f64 = 1.5;
const REACH_MIN_M: f64 = 2.0;

/// A way to lay one part over another.
struct Position {
    /// The other part.
    part: usize,
    /// Frame of the newest part in that of the other one.
    pose: Pose2,
    /// Loops that speak for it.
    votes: usize,
}

/// A position, and how the submaps fit there.
struct Overlay {
    position: Position,
    fits: Vec<Candidate>,
    misfits: usize,
}

impl Overlay {
    /// Share of the submaps' cells that the other part explains, on the average.
    fn explained(&self) -> f64 {
        let shares = self.fits.iter().filter_map(|fit| fit.scores.forward);
        shares.sum::<f64>() / self.fits.len().max(1) as f64
    }
}

impl Mapper {
    /// Joins the newest place's part to another one, where there is no doubt.
    pub(super) fn join(&mut self) {
        let Some(newest) = self.places.len().checked_sub(1) else {
            return;
        };
        let every_m = EVERY_KEYFRAMES * self.config.keyframe.distance_m;
        let path_m = self.places.last().map_or(0.0, |place| place.path_m);
        if !self.config.loops.verify || path_m - self.joined_m < every_m {
            return;
        }
        let part = self.part_of(newest);
        let positions = self.positions(part);
        if positions.is_empty() {
            return;
        }
        self.joined_m = path_m;
        let mut overlays: Vec<Overlay> = positions
            .into_iter()
            .map(|position| self.overlay(part, position))
            .filter(|overlay| overlay.explained() >= EXPLAINED_MIN)
            .collect();
        overlays.sort_by_key(|overlay| core::cmp::Reverse(overlay.fits.len()));
        let mut overlays = overlays.into_iter();
        let Some(best) = overlays.next() else {
            return;
        };
        let fits = best.fits.len();
        let mut rivals = overlays.filter(|rival| rival.position.part == best.position.part);
        let has_rival = rivals.any(|rival| rival.fits.len() as f64 > RIVAL_SHARE * fits as f64);
        let misfits_max = MISFITS_MAX * (fits + best.misfits) as f64;
        if fits >= FITS_MIN && best.misfits as f64 <= misfits_max && !has_rival {
            self.lay_over(part, best);
        }
    }

    /// The positions that unconfirmed loops speak for, those with most of them first.
    fn positions(&self, part: usize) -> Vec<Position> {
        let poses = self.graph.poses();
        let here = poses.last().copied().unwrap_or_default();
        let mut positions: Vec<Position> = Vec::new();
        for candidate in self
            .candidates
            .iter()
            .filter(|c| c.fate == Fate::Unconfirmed)
        {
            let (from, to) = (self.part_of(candidate.from), self.part_of(candidate.to));
            let (Some(a), Some(b)) = (poses.get(candidate.from), poses.get(candidate.to)) else {
                continue;
            };
            // Where `from`'s part has the frame of `to`'s.
            let laid = a.compose(&candidate.relative).compose(&b.inverse());
            let (other, pose) = match (from == part, to == part) {
                (false, true) => (from, laid),
                (true, false) => (to, laid.inverse()),
                _ => continue,
            };
            // Positions are one where they have the robot in one place.
            let same = positions.iter_mut().find(|position| {
                let off = deviation(&position.pose.compose(&here), &pose.compose(&here));
                position.part == other && off.xy().norm() < SAME_M && off.z.abs() < SAME_RAD
            });
            match same {
                Some(position) => position.votes += 1,
                None => positions.push(Position {
                    part: other,
                    pose,
                    votes: 1,
                }),
            }
        }
        positions.retain(|position| self.is_reachable(part, position));
        positions.sort_by_key(|position| core::cmp::Reverse(position.votes));
        positions.truncate(POSITIONS_MAX);
        positions
    }

    /// Whether the robot can have come from the one part to the other in the time between.
    fn is_reachable(&self, part: usize, position: &Position) -> bool {
        let speeds = self.places.iter().map(|place| place.speed_m_s);
        let fastest_m_s = speeds.fold(0.0, f64::max);
        let mut before: Option<(usize, i64, Pose2)> = None;
        let places = self.places.iter().zip(self.graph.poses()).enumerate();
        for (index, (place, pose)) in places {
            let of = self.part_of(index);
            let pose = match of {
                of if of == part => position.pose.compose(pose),
                of if of == position.part => *pose,
                _ => continue,
            };
            if let Some((last, last_ns, from)) = before
                && last != of
            {
                // A clock that was set between the parts says nothing.
                let dark_s = place.stamp_ns.abs_diff(last_ns) as f64 * 1e-9;
                let reach_m = REACH_MIN_M + REACH_SPEEDS * fastest_m_s * dark_s;
                if (pose.translation() - from.translation()).norm() > reach_m {
                    return false;
                }
            }
            before = Some((of, place.stamp_ns, pose));
        }
        true
    }

    /// Lays a part over another one and registers each of its submaps' roots where the other part has been.
    fn overlay(&mut self, part: usize, position: Position) -> Overlay {
        let roots: Vec<usize> = self.submaps.roots().collect();
        let near_m = NEAR_KEYFRAMES * self.config.keyframe.distance_m;
        let mut overlay = Overlay {
            position,
            fits: Vec::new(),
            misfits: 0,
        };
        for to in roots {
            if self.part_of(to) != part {
                continue;
            }
            let Some(pose) = self.graph.poses().get(to) else {
                continue;
            };
            let expected = overlay.position.pose.compose(pose);
            let Some(from) = self.root_near(&expected, overlay.position.part, near_m) else {
                continue;
            };
            match self.fit(from, to, &expected) {
                Some(candidate) => overlay.fits.push(candidate),
                None => overlay.misfits += 1,
            }
        }
        overlay
    }

    /// The submap of the place of a part that is nearest to a pose, by its root.
    fn root_near(&self, pose: &Pose2, part: usize, near_m: f64) -> Option<usize> {
        let distance_m = |place: usize| {
            let at = self.graph.poses().get(place)?;
            let away_m = (at.translation() - pose.translation()).norm();
            (away_m <= near_m).then_some(away_m)
        };
        let places = (0..self.places.len()).filter(|place| self.part_of(*place) == part);
        let (_, nearest) = places
            .filter_map(|place| Some((distance_m(place)?, place)))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let place = self.places.get(nearest)?;
        self.submaps.root_of(place, &self.places)
    }

    /// Registers a place to a submap near where it is expected to be in the submap's part; `None` where it does not
    /// fit. One that fits as well a metre on counts too, but makes no loop.
    fn fit(&mut self, from: usize, to: usize, expected: &Pose2) -> Option<Candidate> {
        self.trail.follow(self.places.get(..=to)?);
        let start = self.graph.poses().get(from)?.between(expected);
        let mut candidate = self.measure(from, to, &[start], Source::Estimate);
        let off = deviation(&start, &candidate.relative);
        let is_near = off.xy().norm() < OFF_MAX_M && off.z.abs() < OFF_MAX_RAD;
        if !is_near || is_alike(&candidate.scores, &self.config.loops).is_err() {
            return None;
        }
        candidate.fate = match is_fixed(&candidate.scores) {
            Ok(()) => Fate::Unconfirmed,
            Err(fate) => fate,
        };
        Some(candidate)
    }

    /// Moves a part to its position and takes its fits as loops.
    fn lay_over(&mut self, part: usize, overlay: Overlay) {
        let Position {
            part: other, pose, ..
        } = overlay.position;
        // The older part keeps its coordinates.
        if other < part {
            self.graph.move_component(part, &pose);
        } else {
            self.graph.move_component(other, &pose.inverse());
        }
        let first = self.candidates.len();
        self.candidates.extend(overlay.fits);
        let is_loop = |(_, candidate): &(usize, &Candidate)| candidate.fate == Fate::Unconfirmed;
        let added = self.candidates.iter().enumerate().skip(first);
        let loops: Vec<usize> = added.filter(is_loop).map(|(index, _)| index).collect();
        self.accept(&loops);
    }
}

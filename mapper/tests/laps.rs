//! What each lap of a long drive is like: how far off its keyframes are under one alignment of
//! all, and which of its revisits were found.

use crate::growth::{root_mean, squares_m2};
use randt_drives::Drive;
use randt_geometry::Pose2;
use randt_mapper::Mapper;

/// A revisit: within this distance of a keyframe this much path ago, m.
const REVISIT_M: f64 = 1.0;
const AGO_M: f64 = 20.0;
/// It is found by a true loop within this path, m.
const FOUND_M: f64 = 2.0;
/// A loop that is off by more is false, m and rad.
const FALSE_M: f64 = 0.5;
const FALSE_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// A lap.
#[derive(Clone, Debug, Default)]
pub struct Lap {
    pub keyframes: usize,
    /// Root mean square, m.
    pub off_m: f64,
    pub revisits: usize,
    pub found: usize,
    pub false_loops: usize,
}

impl Lap {
    /// Share of revisits that were found.
    pub fn recall(&self) -> f64 {
        self.found as f64 / self.revisits.max(1) as f64
    }
}

/// All laps of a drive; the last one may be no whole one.
pub struct Laps(Vec<Lap>);

impl Laps {
    pub fn new(mapper: &Mapper, drive: &Drive, lap_m: f64) -> Self {
        let keyframes = mapper.keyframes();
        let truths = keyframes
            .iter()
            .map(|keyframe| drive.truth(keyframe.stamp_ns));
        let truths: Vec<Pose2> = truths.collect();
        let squares = squares_m2(mapper, drive);
        let lap_of = |index: usize| (keyframes[index].path_m / lap_m) as usize;
        let mut laps = vec![Lap::default(); lap_of(keyframes.len() - 1) + 1];
        let (mut true_at_m, mut lap_squares) = (Vec::new(), vec![Vec::new(); laps.len()]);
        for closure in mapper.found() {
            let [older, newer] = [closure.older, closure.newer].map(|index| index.0);
            let true_pose = truths[older].between(&truths[newer]);
            let off = true_pose.between(&closure.older_from_newer);
            if off.translation().norm() > FALSE_M || off.yaw_rad.abs() > FALSE_RAD {
                laps[lap_of(newer)].false_loops += 1;
            } else {
                true_at_m.push(keyframes[newer].path_m);
            }
        }
        for (index, keyframe) in keyframes.iter().enumerate() {
            let lap = &mut laps[lap_of(index)];
            lap.keyframes += 1;
            lap_squares[lap_of(index)].push(squares[index]);
            let is_near = |other: &Pose2| {
                (other.translation() - truths[index].translation()).norm() < REVISIT_M
            };
            let before = keyframes.partition_point(|it| it.path_m <= keyframe.path_m - AGO_M);
            if truths[..before].iter().any(is_near) {
                lap.revisits += 1;
                let is_found = |at_m: &f64| (at_m - keyframe.path_m).abs() <= FOUND_M;
                lap.found += usize::from(true_at_m.iter().any(is_found));
            }
        }
        for (lap, squares) in laps.iter_mut().zip(&lap_squares) {
            lap.off_m = root_mean(squares);
        }
        Self(laps)
    }

    pub fn lap(&self, lap: usize) -> Option<&Lap> {
        self.0.get(lap)
    }

    /// Those that were driven to their end.
    pub fn whole(&self) -> impl Iterator<Item = &Lap> {
        self.0.iter().take(self.0.len() - 1)
    }

    pub fn last_whole(&self) -> Option<&Lap> {
        self.whole().last()
    }

    pub fn print(&self) {
        println!("lap  keyframes   off m  revisits  recall  false");
        for (lap, it) in self.0.iter().enumerate() {
            println!(
                "{:3} {:10} {:7.4} {:9} {:7.3} {:6}",
                lap + 1,
                it.keyframes,
                it.off_m,
                it.revisits,
                it.recall(),
                it.false_loops
            );
        }
    }
}

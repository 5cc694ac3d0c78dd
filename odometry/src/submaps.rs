//! Submaps: the grids that scans are registered to, opened and closed by distance, overlapping.

mod submap;

use crate::deskew::Point;
use randt_config::{Config, Submap as SubmapConfig};
use randt_geometry::Pose2;
use randt_persist::persist;

pub use submap::Submap;

/// The submap in force and, near its end, the one that follows; both hold the scans of the
/// overlap.
#[derive(Clone, Debug)]
pub struct Submaps {
    config: SubmapConfig,
    active: Submap,
    next: Submap,
    next_is_open: bool,
    /// Number of the next submap.
    next_id: u64,
    /// Where the last scan stood that was inserted.
    odom_from_inserted: Option<Pose2>,
    /// Points that fell outside of a grid.
    pub outside: u64,
}

persist!(Submaps {
    active,
    next,
    next_is_open,
    next_id,
    odom_from_inserted,
    outside,
} kept {
    config,
} sound has_room);

impl Submaps {
    /// Both grids, empty; nothing is allocated later.
    pub fn new(config: &Config) -> Self {
        Self {
            config: config.submap.clone(),
            // Made twice: a clone would have no room beyond what it holds.
            active: Submap::new(config),
            next: Submap::new(config),
            next_is_open: false,
            next_id: 0,
            odom_from_inserted: None,
            outside: 0,
        }
    }

    /// Whether there are numbers left.
    fn has_room(&self) -> bool {
        self.next_id.max(self.outside) <= u64::MAX / 2
    }

    /// Begins anew with a root; numbers of submaps go on.
    pub fn restart(&mut self, root_keyframe: u64, odom_from_root: Pose2) {
        self.active
            .open(self.next_id, root_keyframe, odom_from_root);
        self.next_id += 1;
        self.odom_from_inserted = None;
        self.close_next();
    }

    /// The root in force is at another pose, as long as nothing was inserted.
    pub fn move_root(&mut self, odom_from_root: Pose2) {
        self.active.odom_from_root = odom_from_root;
    }

    /// The root in force gets another number, as long as no keyframe was made.
    pub fn renumber_root(&mut self, root_keyframe: u64) {
        self.active.root_keyframe = root_keyframe;
    }

    /// Number of the next submap.
    pub fn next_id(&self) -> u64 {
        self.next_id
    }

    /// Numbers go on from here.
    pub fn continue_from(&mut self, next_id: u64) {
        self.next_id = next_id;
    }

    /// The submap that scans are registered to.
    pub fn active(&self) -> &Submap {
        &self.active
    }

    /// Empties the submap in force and fills it with one scan: the map before any scan is final.
    pub fn seed(&mut self, odom_from_base: &Pose2, points: &[Point]) {
        self.active.grid.clear();
        self.active.insert(odom_from_base, points);
    }

    /// Opens the next submap at a keyframe where the overlap begins.
    pub fn open_next(&mut self, keyframe: u64, odom_from_base: &Pose2) {
        let travelled = self.active.distance_m(odom_from_base);
        if !self.next_is_open && travelled >= self.config.radius_m - self.config.overlap_m {
            self.next.open(self.next_id, keyframe, *odom_from_base);
            self.next_id += 1;
            self.next_is_open = true;
        }
    }

    /// Adds a scan with its final pose to every open submap where it has moved since the last one;
    /// hands over where the active submap ends.
    pub fn insert(&mut self, odom_from_base: &Pose2, points: &[Point]) {
        let has_moved = self.odom_from_inserted.is_none_or(|odom_from_inserted| {
            let relative = odom_from_inserted.between(odom_from_base);
            relative.translation().norm() >= self.config.insert_distance_m
                || relative.yaw_rad.abs() >= self.config.insert_angle_rad
        });
        if !has_moved {
            return;
        }
        self.odom_from_inserted = Some(*odom_from_base);
        self.outside += self.active.insert(odom_from_base, points);
        if self.next_is_open {
            self.outside += self.next.insert(odom_from_base, points);
            if self.active.distance_m(odom_from_base) >= self.config.radius_m {
                core::mem::swap(&mut self.active, &mut self.next);
                self.close_next();
            }
        }
    }

    /// Emptied at once: what is not read any more must not be saved.
    fn close_next(&mut self) {
        self.next.grid.clear();
        self.next_is_open = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_persist::{Persist, Reader, Writer};

    fn points() -> Vec<Point> {
        let point = |i: u32| Point {
            x_m: 2.0 + 0.01 * f64::from(i),
            y_m: 1.1,
            intensity: 9.0,
            ..Point::default()
        };
        (0..20).map(point).collect()
    }

    /// Drives straight ahead in steps of half a metre, each a keyframe; gives the submap in force
    /// after each.
    fn driven(submaps: &mut Submaps, steps: u64) -> Vec<u64> {
        let step = |keyframe: u64| {
            let pose = Pose2::new(0.5 * keyframe as f64, 0.0, 0.0);
            submaps.open_next(keyframe, &pose);
            submaps.insert(&pose, &points());
            submaps.active().id
        };
        (1..=steps).map(step).collect()
    }

    #[test]
    fn the_next_submap_begins_before_the_active_one_ends() {
        let config = Config::default();
        let mut submaps = Submaps::new(&config);
        submaps.restart(0, Pose2::IDENTITY);
        let ids = driven(&mut submaps, 2 * (2.0 * config.submap.radius_m) as u64);
        assert!(ids.is_sorted() && *ids.last().unwrap() >= 1);
        let first_of_second = ids.iter().position(|id| *id == 1).unwrap() as u64 + 1;
        // Its root is a keyframe of the overlap.
        let overlap = (config.submap.overlap_m / 0.5) as u64;
        let root = submaps.active().root_keyframe;
        assert!(root < ids.len() as u64 && first_of_second > overlap);
    }

    #[test]
    fn a_scan_that_has_not_moved_is_not_inserted_again() {
        let config = Config::default();
        let mut submaps = Submaps::new(&config);
        submaps.restart(0, Pose2::IDENTITY);
        let count = |submaps: &Submaps| submaps.active().grid.cells().map(|c| c.count).sum::<u32>();
        submaps.insert(&Pose2::IDENTITY, &points());
        let once = count(&submaps);
        submaps.insert(&Pose2::IDENTITY, &points());
        assert!(once > 0 && count(&submaps) == once);
        let moved = Pose2::new(config.submap.insert_distance_m, 0.0, 0.0);
        submaps.insert(&moved, &points());
        assert!(count(&submaps) > once);
    }

    #[test]
    fn they_survive_their_process() {
        let config = Config::default();
        let mut whole = Submaps::new(&config);
        whole.restart(0, Pose2::IDENTITY);
        driven(&mut whole, 10);
        let mut bytes = vec![0; 1 << 20];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = Submaps::new(&config);
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.next_id(), whole.next_id());
        assert_eq!(restored.odom_from_inserted, whole.odom_from_inserted);
        assert!(
            restored
                .active()
                .grid
                .cells()
                .eq(whole.active().grid.cells())
        );
    }
}

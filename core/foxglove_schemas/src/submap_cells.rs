//! The cells of odometry's submap, made again from the keyframes that went into it.

use crate::{SceneUpdate, of_cells};
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframePoint, Message};
use randt_ndt::{Cell, Grid};
use std::collections::VecDeque;

/// A keyframe that may be in the next submap too: submaps overlap.
#[derive(Debug)]
struct Scan {
    id: u64,
    pose: Pose2,
    points: Vec<KeyframePoint>,
}

/// The newest keyframe's submap.
#[derive(Debug)]
pub struct SubmapCells {
    grid: Grid,
    /// Odometry frame and number of the submap.
    submap: Option<(u64, u64)>,
    root: Pose2,
    scans: VecDeque<Scan>,
}

impl SubmapCells {
    /// No submap yet, and cells by the rule that odometry made them by.
    pub fn new(config: &Config) -> Self {
        let margin_m = config.submap.radius_m + 2.0 * config.cell_size_m();
        Self {
            grid: Grid::new(config.range_used_m() + margin_m, config.cell_rule()),
            submap: None,
            root: Pose2::IDENTITY,
            scans: VecDeque::new(),
        }
    }

    /// Takes a keyframe; one that was sent again counts once.
    pub fn take(&mut self, keyframe: Message<Keyframe>) {
        let head = &keyframe.head;
        let submap = (head.odom_frame_id, head.submap_id);
        let is_same_frame = self.submap.is_none_or(|(frame, _)| frame == submap.0);
        if !is_same_frame {
            self.scans.clear();
        } else if self.scans.back().is_some_and(|last| head.id <= last.id) {
            return;
        }
        self.scans.push_back(Scan {
            id: head.id,
            pose: Pose2::from_array(head.pose),
            points: keyframe.items,
        });
        if self.submap == Some(submap) {
            if let Some(scan) = self.scans.back() {
                insert(&mut self.grid, &self.root, scan);
            }
        } else {
            self.submap = Some(submap);
            self.begin(head.submap_root);
        }
        self.grid.refresh();
    }

    /// A submap begins at its root, which may lie some keyframes back; where the log does not
    /// reach so far, at its first.
    fn begin(&mut self, root: u64) {
        self.scans.retain(|scan| scan.id >= root);
        self.grid.clear();
        self.root = self.scans.front().map_or(self.root, |scan| scan.pose);
        for scan in &self.scans {
            insert(&mut self.grid, &self.root, scan);
        }
    }

    /// The cells in the frame of the submap's root, and where that lies in `odom`.
    pub fn cells(&self) -> (impl Iterator<Item = &Cell>, [f64; 3]) {
        (self.grid.cells(), self.root.to_array())
    }

    /// The cells as they now are.
    pub fn draw(&self, stamp_ns: i64) -> SceneUpdate {
        of_cells(self.grid.cells(), self.root.to_array(), stamp_ns)
    }
}

fn insert(grid: &mut Grid, root: &Pose2, scan: &Scan) {
    let relative = root.between(&scan.pose);
    for point in &scan.points {
        let at = relative.transform([f64::from(point.x_m), f64::from(point.y_m)].into());
        // One outside of the grid, or of no place at all, is in no cell.
        let _ = grid.add([at.x, at.y, f64::from(point.intensity)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A keyframe that sees a spot one metre ahead.
    fn keyframe(id: u64, x_m: f64, [submap, root]: [u64; 2]) -> Message<Keyframe> {
        let mut keyframe = Message::<Keyframe>::default();
        let head = &mut *keyframe.head;
        (head.id, head.submap_id, head.submap_root) = (id, submap, root);
        head.pose = [x_m, 0.0, 0.0];
        let point = |n: u16| KeyframePoint {
            x_m: 1.05 + 0.01 * f32::from(n),
            y_m: 0.1 + 0.02 * f32::from(n % 2),
            intensity: 9.0,
            ..KeyframePoint::default()
        };
        keyframe.items = (0..8).map(point).collect();
        keyframe
    }

    #[test]
    fn a_submap_has_what_came_since_its_root() {
        let mut cells = SubmapCells::new(&Config::default());
        let count = |cells: &SubmapCells| cells.grid.cells().map(|cell| cell.count).sum::<u32>();
        (0..4).for_each(|id| cells.take(keyframe(id, 3.0 * id as f64, [0, 0])));
        assert_eq!(count(&cells), 32);
        cells.take(keyframe(3, 9.0, [0, 0]));
        assert_eq!(count(&cells), 32, "it came again");
        // The next one was begun two keyframes ago.
        cells.take(keyframe(4, 12.0, [1, 2]));
        assert_eq!(count(&cells), 24);
        assert_eq!(cells.root.x_m, 6.0);
        // Odometry begins anew.
        let mut lost = keyframe(5, 0.0, [2, 5]);
        lost.head.odom_frame_id = 1;
        cells.take(lost);
        assert_eq!((count(&cells), cells.root.x_m), (8, 0.0));
    }
}

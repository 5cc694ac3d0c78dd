//! Whether the newest scan shows the world that the scans before it showed, or another one: that
//! of a robot that was carried elsewhere.

use crate::{earlier_cells::EarlierCells, sliding_window::WindowScan};
use randt_config::Config;
use randt_ndt::Cell;
use randt_persist::persist;

/// Cells from which a scan can be compared.
const CELLS_MIN: usize = 10;
/// Squared distance from a cell of the scan before up to which it is there.
const THERE_MAX: f64 = 9.0;
/// Share of the cells of the scan that has fewer that are there, below which two scans in a row
/// show two worlds: 0.0 to 0.42 where a robot was carried elsewhere, over 0.54 in sound drives,
/// behind a frozen radar and where vehicles come and go.
const OVERLAP_MIN: f64 = 0.45;
/// ... and below which the next ones still show the other one.
const STILL_OVERLAP_MIN: f64 = 0.6;
/// By how much more each of the next ones has to overlap with the one before it than with the
/// world as it was: bursts of another radar agree with none.
const AGREES_MIN: f64 = 0.2;
/// Scans in a row that show another world from which it is no chance.
const JUMPED_SCANS: u32 = 3;
/// A scan is compared with one that is no older than this, ns: afterwards, where the robot is may
/// have become another place without a jump.
const AGE_MAX_NS: i64 = 1_000_000_000;

/// Follows the world from scan to scan.
#[derive(Clone, Debug)]
pub struct ScanOverlap {
    cell_size_m: f64,
    /// The last scan of the world as it was, and the end of its sweep, ns.
    last: EarlierCells,
    last_ns: i64,
    /// The last scan of another one.
    other: EarlierCells,
    /// Scans up to it, in a row, that show another one and agree.
    strange: u32,
}

persist!(ScanOverlap {
    last,
    last_ns,
    other,
    strange,
} kept {
    cell_size_m,
} sound is_sound);

impl ScanOverlap {
    /// Nothing seen yet.
    pub fn new(config: &Config) -> Self {
        Self {
            cell_size_m: config.cell_size_m(),
            last: EarlierCells::with_room(),
            last_ns: 0,
            other: EarlierCells::with_room(),
            strange: 0,
        }
    }

    /// Whether it can go on counting.
    fn is_sound(&self) -> bool {
        self.strange <= u32::MAX / 2
    }

    /// Forgets everything: the next scan is the first one of a world.
    pub fn restart(&mut self) {
        self.last.clear();
        self.other.clear();
        self.strange = 0;
    }

    /// Compares the newest scan with the last one.
    pub fn observe(&mut self, scan: &WindowScan) {
        let end_ns = scan.message.head.sweep.end_ns;
        let is_old = end_ns.saturating_sub(self.last_ns) > AGE_MAX_NS;
        let is_comparable = !is_old && self.last.len().min(scan.cells.len()) >= CELLS_MIN;
        let overlap = self.overlap(&self.last, scan);
        let least = if self.is_strange() {
            STILL_OVERLAP_MIN
        } else {
            OVERLAP_MIN
        };
        if is_comparable && overlap < least {
            let agrees =
                self.is_strange() && self.overlap(&self.other, scan) > overlap + AGREES_MIN;
            self.strange = if agrees { self.strange + 1 } else { 1 };
            self.other.set(scan, |_| true);
        } else {
            self.strange = 0;
            self.last.set(scan, |_| true);
            self.last_ns = end_ns;
        }
    }

    /// Share of the cells of the scan that has fewer that are where the other one has them: what
    /// another radar adds does not count alone.
    fn overlap(&self, earlier: &EarlierCells, scan: &WindowScan) -> f64 {
        let is_there = |cell: &Cell| earlier.nearest(cell, self.cell_size_m) <= THERE_MAX;
        let there = scan.cells.iter().filter(|cell| {
            is_there(&earlier.standing(cell, scan)) || is_there(&earlier.carried(cell, scan))
        });
        there.count() as f64 / scan.cells.len().min(earlier.len()).max(1) as f64
    }

    /// Whether the newest scan shows another world.
    pub fn is_strange(&self) -> bool {
        self.strange > 0
    }

    /// Whether the world is another one.
    pub fn has_jumped(&self) -> bool {
        self.strange >= JUMPED_SCANS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use randt_geometry::Pose2;
    use randt_ndt::ScanCell;
    use randt_persist::{Persist, Reader, Writer};

    const SWEEP_NS: i64 = 200_000_000;

    /// A scan of this number in a world of this number, in which nothing is where it is in others.
    fn scan(number: i64, world: u32) -> WindowScan {
        let mut scan = WindowScan::default();
        scan.message.head.sweep.end_ns = number * SWEEP_NS;
        let x_m = 0.2 * number as f64;
        scan.state.odom_from_base = Pose2::new(x_m, 0.0, 0.0);
        scan.deskew_velocity = Vector3::new(1.0, 0.0, 0.0);
        let cell = |index: i64| {
            let cell = Cell {
                mean: [2.0 * index as f64 - x_m, 3.0 + 1.5 * f64::from(world), 20.0],
                covariance: [0.01, 0.0, 0.01, 0.0, 0.0, 4.0],
                count: 20,
            };
            ScanCell::new(&cell, 0.0)
        };
        scan.cells.extend((0..20).map(cell));
        scan
    }

    /// Whether each scan is strange, and whether the world has jumped.
    fn observed(scans: &[(i64, u32)]) -> Vec<(bool, bool)> {
        let mut overlap = ScanOverlap::new(&Config::default());
        let observe = |(number, world): &(i64, u32)| {
            overlap.observe(&scan(*number, *world));
            (overlap.is_strange(), overlap.has_jumped())
        };
        scans.iter().map(observe).collect()
    }

    #[test]
    fn another_world_is_strange_at_once_and_a_jump_when_it_stays() {
        const SAME: (bool, bool) = (false, false);
        const STRANGE: (bool, bool) = (true, false);
        let scans = [(0, 0), (1, 0), (2, 1), (3, 1), (4, 1)];
        assert_eq!(
            observed(&scans),
            [SAME, SAME, STRANGE, STRANGE, (true, true)]
        );
        // Bursts of another radar do not agree, and pass.
        let scans = [
            (0, 0),
            (1, 1),
            (2, 2),
            (3, 3),
            (4, 4),
            (5, 0),
            (6, 1),
            (7, 0),
        ];
        assert_eq!(
            observed(&scans),
            [
                SAME, STRANGE, STRANGE, STRANGE, STRANGE, SAME, STRANGE, SAME
            ]
        );
        // Behind a gap the robot may be anywhere.
        assert_eq!(observed(&[(0, 0), (6, 1), (7, 1)]), [SAME; 3]);
    }

    #[test]
    fn it_survives_its_process() {
        let config = Config::default();
        let mut whole = ScanOverlap::new(&config);
        for (number, world) in [(0, 0), (1, 1), (2, 1)] {
            whole.observe(&scan(number, world));
        }
        let mut bytes = vec![0; 1 << 16];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = ScanOverlap::new(&config);
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        restored.observe(&scan(3, 1));
        assert!(restored.has_jumped());
    }
}

//! What keeps its place at the robot while the robot moves, as vehicles that drive along: taken
//! for something that stands, it says that the robot does.

use crate::{
    earlier_cells::EarlierCells,
    sliding_window::{CELLS, WindowScan},
};
use nalgebra::{Matrix2, Vector2};
use randt_config::Config;
use randt_ndt::ScanCell;
use randt_persist::persist;

/// Way since an earlier scan from which the newest one is compared with it, m: walls are thinner.
const WAY_MIN_M: f64 = 0.4;
/// Squared distance, in its own noise, between where a cell is if it stands and if it moves along,
/// from which it can tell the two apart: walls along the way cannot.
const APART_MIN: f64 = 9.0;
/// Squared distance from a cell of the earlier scan up to which a cell is there, and from which it
/// is not.
const THERE_MAX: f64 = 4.0;
const GONE_MIN: f64 = 9.0;
/// Cells that move along from which they are no chance, and their share of those that can tell,
/// and as long as they are followed from scan to scan. Two vehicles are 4 to 13 cells and half or
/// more at first; a scan of sound drives has both once in some thousand.
const MOVING_MIN: usize = 4;
const SHARE_MIN: f64 = 0.45;
const FOLLOWED_SHARE_MIN: f64 = 0.3;
/// Scans in a row that must have it before it is taken out, and before it is a reason of trust:
/// people who walk along and the ground ahead on a slope have it for two to four.
const SCANS_MIN: u32 = 2;
const LASTING_SCANS_MIN: u32 = 5;

/// Finds it in the newest scan and takes it out.
#[derive(Clone, Debug)]
pub struct MovingClutter {
    cell_size_m: f64,
    /// Two scans before, the later one first: at least one has the way that it takes.
    earlier: [EarlierCells; 2],
    /// What moved along in the last scan: as long as nothing tells otherwise, it still does.
    last: EarlierCells,
    /// Scans in a row, up to the last one, that have it.
    in_a_row: u32,
    /// By cell of the newest scan.
    judged: Vec<Judged>,
}

persist!(MovingClutter {
    earlier,
    last,
    in_a_row,
} kept {
    cell_size_m,
    judged,
} sound is_sound);

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Judged {
    /// It is where it would be if it stood, and not where it would be if it moved along.
    Stands,
    /// The other way round.
    Moves,
    /// It may be where it would be if it stood, but cannot tell.
    MayStand,
    /// Nothing is known.
    Unclear,
}

impl MovingClutter {
    /// Nothing seen yet. What is never written costs no memory.
    pub fn new(config: &Config) -> Self {
        Self {
            cell_size_m: config.cell_size_m(),
            earlier: [EarlierCells::with_room(), EarlierCells::with_room()],
            last: EarlierCells::with_room(),
            in_a_row: 0,
            judged: Vec::with_capacity(CELLS),
        }
    }

    /// Whether it can go on counting.
    fn is_sound(&self) -> bool {
        self.in_a_row <= u32::MAX / 2
    }

    /// Whether it is there long enough to speak against the pose.
    pub fn lasts(&self) -> bool {
        self.in_a_row >= LASTING_SCANS_MIN
    }

    /// Whether the newest scan has it.
    fn is_there(&self) -> bool {
        self.in_a_row >= SCANS_MIN
    }

    /// Forgets everything: what comes is in another frame.
    pub fn restart(&mut self) {
        let [later, before] = &mut self.earlier;
        for cells in [later, before, &mut self.last] {
            cells.clear();
        }
        self.in_a_row = 0;
    }

    /// Takes what moves along out of the newest scan's cells.
    pub fn take_out(&mut self, scan: &mut WindowScan) {
        self.judge(scan);
        let count = |what| self.judged.iter().filter(|judged| **judged == what).count();
        let (moving, standing) = (count(Judged::Moves), count(Judged::Stands));
        let share = moving as f64 / (moving + standing).max(1) as f64;
        let share_min = if self.is_there() {
            FOLLOWED_SHARE_MIN
        } else {
            SHARE_MIN
        };
        if moving >= MOVING_MIN && share >= share_min {
            self.in_a_row += 1;
        } else {
            self.in_a_row = 0;
        }

        let [later, _] = &self.earlier;
        if later.len() == 0 || later.way_m(scan) >= WAY_MIN_M {
            self.earlier.swap(0, 1);
            self.earlier[0].set(scan, |_| true);
        }
        let (judged, is_there) = (&self.judged, self.is_there());
        let moves = |index: usize| is_there && judged.get(index) == Some(&Judged::Moves);
        self.last.set(scan, moves);
        let mut indices = 0..;
        scan.cells.retain(|_| !indices.next().is_some_and(&moves));
    }

    /// Judges each cell of a scan.
    fn judge(&mut self, scan: &WindowScan) {
        let is_far =
            |earlier: &&EarlierCells| earlier.len() > 0 && earlier.way_m(scan) >= WAY_MIN_M;
        let earlier = self.earlier.iter().find(is_far);
        let (last, reach_m) = (&self.last, self.cell_size_m);
        let judged = |cell: &ScanCell| {
            let judged = earlier.map_or(Judged::Unclear, |it| judge(cell, scan, it, reach_m));
            let still_moves = judged == Judged::Unclear
                && last.nearest(&last.carried(cell, scan), reach_m) <= THERE_MAX;
            if still_moves { Judged::Moves } else { judged }
        };
        self.judged.clear();
        self.judged.extend(scan.cells.iter().map(judged));
    }
}

/// Judges a cell of a scan by an earlier one.
fn judge(cell: &ScanCell, scan: &WindowScan, earlier: &EarlierCells, reach_m: f64) -> Judged {
    let standing = earlier.standing(cell, scan);
    let moving = earlier.carried(cell, scan);
    let apart = Vector2::new(
        standing.mean[0] - moving.mean[0],
        standing.mean[1] - moving.mean[1],
    );
    let [xx, xy, yy, ..] = moving.covariance;
    let noise = Matrix2::new(xx, xy, xy, yy) * 2.0;
    let inverse = noise.try_inverse().unwrap_or_default();
    if apart.dot(&(inverse * apart)) < APART_MIN {
        return Judged::MayStand;
    }
    let by_standing = earlier.nearest(&standing, reach_m);
    let by_moving = earlier.nearest(&moving, reach_m);
    match (by_standing <= THERE_MAX, by_moving <= THERE_MAX) {
        (true, false) if by_moving >= GONE_MIN => Judged::Stands,
        (true, _) => Judged::MayStand,
        (false, true) if by_standing >= GONE_MIN => Judged::Moves,
        (false, _) => Judged::Unclear,
    }
}

#[cfg(test)]
mod tests;

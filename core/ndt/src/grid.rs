//! A regular grid of cells over a square, with a dense index: no tree, no hash.

use crate::{Cell, CellRule, Distribution};
use randt_persist::{Error, Persist, Reader, Writer};

const NONE: u32 = u32::MAX;
/// Squares with points that room is made for at once (10 MB); no sensor's scans fill more, but
/// tiny cells could ask for more memory than there is.
const ROOM_MAX: usize = 65_536;

/// Cells over the square from -half to +half in x and y.
///
/// `add` points, then `refresh`, then ask for cells. Nothing is allocated after `new` up to 65,536
/// squares with points.
#[derive(Clone, Debug)]
pub struct Grid {
    inverse_size: f64,
    cell_size_m: f64,
    half_cells: i64,
    width: usize,
    rule: CellRule,
    /// Cell of each square, row by row in y; `NONE` where no point fell.
    cell_of_square: Vec<u32>,
    /// Square of each cell.
    squares: Vec<u32>,
    sums: Vec<Distribution>,
    /// As of the last refresh; `count` 0 where there are too few points.
    cells: Vec<Cell>,
    dirty: Vec<u32>,
    is_dirty: Vec<bool>,
}

impl Grid {
    /// An empty grid that covers at least `half_width_m` to each side of the origin.
    pub fn new(half_width_m: f64, rule: CellRule) -> Self {
        let cell_size_m = rule.cell_size_m;
        let half_cells = (half_width_m / cell_size_m).ceil().max(1.0) as i64;
        let width = 2 * half_cells as usize;
        let squares = width * width;
        let room = squares.min(ROOM_MAX);
        Self {
            inverse_size: 1.0 / cell_size_m,
            cell_size_m,
            half_cells,
            width,
            rule,
            cell_of_square: vec![NONE; squares],
            squares: Vec::with_capacity(room),
            sums: Vec::with_capacity(room),
            cells: Vec::with_capacity(room),
            dirty: Vec::with_capacity(room),
            is_dirty: Vec::with_capacity(room),
        }
    }

    /// Edge of a square, m.
    pub fn cell_size_m(&self) -> f64 {
        self.cell_size_m
    }

    /// Takes every point out.
    pub fn clear(&mut self) {
        for square in self.squares.drain(..) {
            if let Some(index) = self.cell_of_square.get_mut(square as usize) {
                *index = NONE;
            }
        }
        self.sums.clear();
        self.cells.clear();
        self.dirty.clear();
        self.is_dirty.clear();
    }

    /// Column and row of a position, which may lie outside. Floors: squares at the axes are as
    /// large as others.
    #[inline]
    fn square_of(&self, x_m: f64, y_m: f64) -> (i64, i64) {
        let index = |position_m: f64| floor(position_m * self.inverse_size);
        (index(x_m), index(y_m))
    }

    #[inline]
    fn square_index(&self, column: i64, row: i64) -> Option<usize> {
        let inside = |v: i64| (-self.half_cells..self.half_cells).contains(&v);
        (inside(column) && inside(row)).then(|| {
            (row + self.half_cells) as usize * self.width + (column + self.half_cells) as usize
        })
    }

    /// Adds a point (x m, y m, intensity); gives the index of its cell, `None` outside of the grid
    /// or where it is not finite.
    #[inline]
    pub fn add(&mut self, point: [f64; 3]) -> Option<usize> {
        let [x_m, y_m, _] = point;
        self.add_in_square_at([x_m, y_m], point)
    }

    /// The same, in the square at another position than the point's own: cells of a scan in its
    /// own frame that are cut by squares of another frame.
    #[inline]
    pub fn add_in_square_at(&mut self, position_m: [f64; 2], point: [f64; 3]) -> Option<usize> {
        if !(point[0].is_finite() && point[1].is_finite() && point[2].is_finite()) {
            return None;
        }
        let (column, row) = self.square_of(position_m[0], position_m[1]);
        let square = self.square_index(column, row)?;
        let entry = self.cell_of_square.get_mut(square)?;
        if *entry == NONE {
            *entry = self.sums.len() as u32;
            self.squares.push(square as u32);
            self.sums.push(Distribution::default());
            self.cells.push(Cell::default());
            self.is_dirty.push(false);
        }
        let cell = *entry as usize;
        self.sums.get_mut(cell)?.add(point);
        let dirty = self.is_dirty.get_mut(cell)?;
        if !*dirty {
            *dirty = true;
            self.dirty.push(cell as u32);
        }
        Some(cell)
    }

    /// Brings the cells up to the points.
    pub fn refresh(&mut self) {
        for index in self.dirty.drain(..) {
            let index = index as usize;
            if let (Some(sum), Some(cell), Some(dirty)) = (
                self.sums.get(index),
                self.cells.get_mut(index),
                self.is_dirty.get_mut(index),
            ) {
                *cell = Cell::new(sum, self.rule).unwrap_or_default();
                *dirty = false;
            }
        }
    }

    /// Number of squares that hold points.
    pub fn occupied(&self) -> usize {
        self.sums.len()
    }

    /// A cell by its index, as of the last refresh; `None` where it has too few points.
    #[inline]
    pub fn cell(&self, index: usize) -> Option<&Cell> {
        self.cells.get(index).filter(|cell| cell.count > 0)
    }

    /// Sample statistics of a cell by its index.
    pub fn distribution(&self, index: usize) -> Option<&Distribution> {
        self.sums.get(index)
    }

    /// All cells with enough points, in the order in which their squares were first hit.
    pub fn cells(&self) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(|cell| cell.count > 0)
    }

    /// Calls `visit(index, cell)` for the cells in the squares around a position, `radius` squares
    /// to each side, row by row.
    #[inline]
    pub fn for_each_near(
        &self,
        x_m: f64,
        y_m: f64,
        radius: i64,
        mut visit: impl FnMut(u32, &Cell),
    ) {
        let (column, row) = self.square_of(x_m, y_m);
        let low = -self.half_cells;
        let high = self.half_cells - 1;
        let near =
            |at: i64| at.saturating_sub(radius).max(low)..=at.saturating_add(radius).min(high);
        for r in near(row) {
            let start = (r + self.half_cells) as usize * self.width;
            for c in near(column) {
                let square = start + (c + self.half_cells) as usize;
                let index = self.cell_of_square.get(square).copied().unwrap_or(NONE);
                if let Some(cell) = self.cell(index as usize) {
                    visit(index, cell);
                }
            }
        }
    }
}

/// Squares and sums are enough: the index, and the cells as of a refresh, are made from them
/// again.
impl Persist for Grid {
    fn save(&self, out: &mut Writer<'_>) {
        self.squares.save(out);
        self.sums.iter().for_each(|sum| sum.save(out));
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.clear();
        let mut count = 0_usize;
        count.restore(from)?;
        for index in 0..count {
            let mut square = 0_u32;
            square.restore(from)?;
            // Refuses a square twice, too; so there are never more than the grid has.
            match self.cell_of_square.get_mut(square as usize) {
                Some(entry) if *entry == NONE => *entry = index as u32,
                _ => return Err(Error::Unsound("Grid")),
            }
            self.squares.push(square);
        }
        for _ in 0..count {
            let mut sum = Distribution::default();
            sum.restore(from)?;
            self.cells
                .push(Cell::new(&sum, self.rule).unwrap_or_default());
            self.sums.push(sum);
            self.is_dirty.push(false);
        }
        Ok(())
    }
}

/// Largest whole number at or below, without the call that `f64::floor` is on baseline x86-64.
///
/// `as` saturates: NaN goes to 0 and infinities to the far outside.
#[inline]
fn floor(value: f64) -> i64 {
    let truncated = value as i64;
    truncated.saturating_sub(i64::from(value < truncated as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        let rule = CellRule {
            points_min: 2,
            use_intensity: true,
            cell_size_m: 0.5,
            slack: 0.0,
        };
        Grid::new(4.0, rule)
    }

    #[test]
    fn squares_at_the_axes_are_not_larger_than_others() {
        let mut grid = grid();
        for x in [-0.6, -0.4, -0.1, 0.1, 0.4, 0.6] {
            grid.add([x, 0.1, 1.0]);
        }
        assert_eq!(grid.occupied(), 4);
    }

    #[test]
    fn floor_is_the_largest_whole_number_below() {
        let values = [-1.0, -0.5, 0.0, 0.5, -1e9 - 0.25, 7.999];
        assert_eq!(values.map(floor), [-1, -1, 0, 0, -1_000_000_001, 7]);
        assert_eq!(
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(floor),
            [0, i64::MAX, i64::MIN]
        );
    }

    #[test]
    fn points_outside_or_not_finite_are_refused() {
        let mut grid = grid();
        for p in [
            [4.01, 0.0, 1.0],
            [0.0, -4.01, 1.0],
            [f64::NAN, 0.0, 1.0],
            [f64::INFINITY, 0.0, 1.0],
            [0.0, 0.0, f64::NAN],
        ] {
            assert_eq!(grid.add(p), None, "{p:?}");
        }
        assert_eq!(grid.add([3.99, -3.99, 1.0]), Some(0));
    }

    #[test]
    fn clearing_takes_every_point_out() {
        let mut grid = grid();
        for i in 0..9 {
            grid.add([0.1, 0.05 * f64::from(i), 1.0]);
        }
        grid.refresh();
        assert_eq!(grid.cells().count(), 1);
        grid.clear();
        grid.refresh();
        assert_eq!((grid.cells().count(), grid.occupied()), (0, 0));
        let mut near = 0;
        grid.for_each_near(0.1, 0.1, 3, |_, _| near += 1);
        assert_eq!(near, 0);
    }

    #[test]
    fn a_restored_grid_goes_on_as_if_nothing_had_been() {
        let mut whole = grid();
        let point = |i: u32| {
            let i = f64::from(i);
            [(i * 0.37) % 3.9, (i * 0.61) % 3.9 - 2.0, i % 7.0]
        };
        (0..200).for_each(|i| assert!(whole.add(point(i)).is_some()));
        whole.refresh();
        let mut bytes = vec![0; 1 << 16];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = grid();
        // What it held is gone.
        restored.add([3.0, 3.0, 1.0]);
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        for grid in [&mut whole, &mut restored] {
            (200..300).for_each(|i| assert!(grid.add(point(i)).is_some()));
            grid.refresh();
        }
        assert_eq!(whole.cell_of_square, restored.cell_of_square);
        assert_eq!(whole.sums, restored.sums);
        assert_eq!(whole.cells, restored.cells);
        assert_eq!(whole.sums.capacity(), restored.sums.capacity());
    }

    #[test]
    fn squares_that_are_twice_or_not_in_the_grid_are_refused() {
        let mut bytes = [0; 1000];
        for squares in [vec![3_u32, 3], vec![1 << 20]] {
            let mut out = Writer::new(&mut bytes);
            squares.save(&mut out);
            let result = grid().restore(&mut Reader::new(&bytes));
            assert_eq!(result, Err(Error::Unsound("Grid")));
        }
    }

    #[test]
    fn the_neighbourhood_ends_at_the_border() {
        let mut grid = grid();
        for p in [
            [3.9, 3.9, 1.0],
            [3.9, 3.8, 2.0],
            [-3.9, -3.9, 1.0],
            [-3.9, -3.8, 1.0],
        ] {
            grid.add(p);
        }
        grid.refresh();
        let mut near = Vec::new();
        grid.for_each_near(4.2, 4.2, 1, |index, _| near.push(index));
        assert_eq!(near, [0]);
        grid.for_each_near(1e300, f64::NAN, 1, |index, _| near.push(index));
        assert_eq!(near, [0]);
    }
}

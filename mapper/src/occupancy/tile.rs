//! A square of the grid with its counters.

use super::stencil::{HIT, MISS};

/// Cells along an edge: 6.4 m of cells of 0.1 m, a room. Counters of a tile take 32 KiB.
pub use randt_messages::TILE_CELLS;

const COUNT: usize = TILE_CELLS * TILE_CELLS;

/// Column and row of a tile; cell (0, 0) is the lower left one of tile (0, 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TileIndex {
    /// Row, upwards.
    pub y: i32,
    /// Column, to the right.
    pub x: i32,
}

/// The votes on one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCount {
    /// Keyframes that had a return from it.
    pub hits: u32,
    /// Keyframes that looked through it and had none.
    pub misses: u32,
}

/// Counters of [`TILE_CELLS`]^2 cells, row by row from the lower left one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    hits: Box<[u32; COUNT]>,
    misses: Box<[u32; COUNT]>,
    /// Version of the map in which it last changed.
    pub version: u64,
}

impl Default for Tile {
    fn default() -> Self {
        Self {
            hits: Box::new([0; COUNT]),
            misses: Box::new([0; COUNT]),
            version: 0,
        }
    }
}

impl Tile {
    /// The counters, row by row from the lower left cell.
    pub fn cells(&self) -> impl Iterator<Item = CellCount> + '_ {
        let pairs = self.hits.iter().zip(self.misses.iter());
        pairs.map(|(&hits, &misses)| CellCount { hits, misses })
    }

    /// The counters of a cell; zero outside.
    pub fn cell(&self, column: usize, row: usize) -> CellCount {
        let index = row * TILE_CELLS + column;
        CellCount {
            hits: self.hits.get(index).copied().unwrap_or_default(),
            misses: self.misses.get(index).copied().unwrap_or_default(),
        }
    }

    /// Whether no cell has a vote.
    pub fn is_empty(&self) -> bool {
        self.hits.iter().all(|&count| count == 0) && self.misses.iter().all(|&count| count == 0)
    }

    /// Whether every cell counts the same.
    pub(crate) fn has_same_counts(&self, other: &Self) -> bool {
        self.hits == other.hits && self.misses == other.misses
    }

    /// Adds votes to cells of a row from a column on, or takes them out again.
    pub(crate) fn count(&mut self, column: usize, row: usize, votes: &[u8], change: Change) {
        let range = row * TILE_CELLS + column..row * TILE_CELLS + column + votes.len();
        let (Some(hits), Some(misses)) =
            (self.hits.get_mut(range.clone()), self.misses.get_mut(range))
        else {
            return;
        };
        // Wrapping: what is added first and taken out later may pass zero in between, never at the
        // end.
        for ((hits, misses), &vote) in hits.iter_mut().zip(misses).zip(votes) {
            *hits = hits.wrapping_add_signed(change as i32 * i32::from(vote == HIT));
            *misses = misses.wrapping_add_signed(change as i32 * i32::from(vote == MISS));
        }
    }
}

/// Whether votes come or go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// They come.
    Add = 1,
    /// They go.
    Remove = -1,
}

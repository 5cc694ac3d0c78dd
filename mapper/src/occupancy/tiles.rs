//! All tiles: where votes are counted, which of them changed when, which are empty again.

use super::stencil::{NONE, Stencil};
use super::tile::{Change, TILE_CELLS, Tile, TileIndex};
use std::collections::BTreeMap;

/// The tiles that hold something.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    tiles: BTreeMap<TileIndex, Tile>,
    /// Versions in which tiles became empty.
    gone: BTreeMap<TileIndex, u64>,
    /// Version of the last finished change.
    pub version: u64,
}

impl Tiles {
    /// By index.
    pub fn iter(&self) -> impl Iterator<Item = (TileIndex, &Tile)> {
        self.tiles.iter().map(|(&index, tile)| (index, tile))
    }

    /// A tile that holds something.
    pub fn get(&self, index: TileIndex) -> Option<&Tile> {
        self.tiles.get(&index)
    }

    /// Version in which a tile last changed or became empty; 0 where there never was one.
    pub fn changed_at(&self, index: TileIndex) -> u64 {
        let there = self.tiles.get(&index).map(|tile| tile.version);
        let gone = || self.gone.get(&index).copied();
        there.or_else(gone).unwrap_or(0)
    }

    /// Tiles that became empty after a version.
    pub fn gone_since(&self, version: u64) -> impl Iterator<Item = TileIndex> {
        let gone = self.gone.iter().filter(move |(_, then)| **then > version);
        gone.map(|(&index, _)| index)
    }

    /// Takes all tiles away, to count anew. Give them to [`Self::finish`].
    pub fn take(&mut self) -> BTreeMap<TileIndex, Tile> {
        std::mem::take(&mut self.tiles)
    }

    /// Adds a stencil's votes to the tiles under it, or takes them out.
    pub fn count(&mut self, stencil: &Stencil, change: Change) {
        let edge = TILE_CELLS as i32;
        let [left, bottom] = stencil.corner;
        let [width, height] = stencil.size.map(|cells| cells as i32);
        let (right, top) = (left + width, bottom + height);
        if stencil.size[0] == 0 {
            return;
        }
        for y in bottom.div_euclid(edge)..=(top - 1).div_euclid(edge) {
            for x in left.div_euclid(edge)..=(right - 1).div_euclid(edge) {
                let columns = left.max(x * edge)..right.min((x + 1) * edge);
                let rows = bottom.max(y * edge)..top.min((y + 1) * edge);
                let from_left = (columns.start - left) as usize..(columns.end - left) as usize;
                let votes = |row: i32| stencil.row((row - bottom) as usize, from_left.clone());
                let is_vote = |&vote: &u8| vote != NONE;
                if !rows.clone().any(|row| votes(row).iter().any(is_vote)) {
                    continue;
                }
                let tile = self.tiles.entry(TileIndex { y, x }).or_default();
                tile.version = self.version + 1;
                for row in rows {
                    let column = (columns.start - x * edge) as usize;
                    tile.count(column, (row - y * edge) as usize, votes(row), change);
                }
            }
        }
    }

    /// Ends a change: empty tiles go, and the version rises if anything is not as it was. `before`
    /// holds what [`Self::take`] gave, if tiles were counted anew.
    pub fn finish(&mut self, before: &BTreeMap<TileIndex, Tile>) {
        let next = self.version + 1;
        let mut is_changed = false;
        for &index in before.keys() {
            if !self.tiles.contains_key(&index) {
                self.gone.insert(index, next);
                is_changed = true;
            }
        }
        self.tiles.retain(|index, tile| {
            if let Some(old) = before.get(index).filter(|old| old.has_same_counts(tile)) {
                tile.version = old.version;
            }
            if tile.version != next {
                return true;
            }
            is_changed = true;
            let is_empty = tile.is_empty();
            if is_empty {
                self.gone.insert(*index, next);
            } else {
                self.gone.remove(index);
            }
            !is_empty
        });
        self.version += u64::from(is_changed);
    }
}

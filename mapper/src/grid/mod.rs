//! The occupancy grid: where keyframes' beams passed and where they ended.
//!
//! Responsible for counters that follow the graph. Every keyframe's votes can be taken out at its old pose and put in
//! at its new one, to the last bit: the grid is a function of the keyframes and where they are now, not of the order
//! or the way in which they came there. Not responsible for keeping keyframes, for poses, nor for files.

mod lattice;
mod pgm;
mod ray;
mod stencil;
mod tile;

pub use pgm::Picture;
pub use tile::{CellCount, TILE_CELLS, Tile, TileIndex};

use lattice::LatticePose;
use randt_geometry::Pose2;
use randt_messages::{KeyframeBeam, KeyframePoint};
use std::collections::BTreeMap;
use stencil::{NONE, Stencil};
use tile::Change;

/// A keyframe as the grid needs it. What belongs to an id never changes but for the pose.
#[derive(Clone, Copy, Debug)]
pub struct GridKeyframe<'a> {
    /// Its number.
    pub id: u64,
    /// `base_link` at the sweep's end in the map.
    pub pose: Pose2,
    /// Beams, with the first of each one's points.
    pub beams: &'a [KeyframeBeam],
    /// Points in `base_link`, by beam, then range.
    pub points: &'a [KeyframePoint],
}

/// What an update did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GridUpdate {
    /// Keyframes painted for the first time.
    pub added: usize,
    /// Keyframes painted anew because they had moved.
    pub moved: usize,
    /// Keyframes taken out.
    pub removed: usize,
    /// Keyframes without a place: their pose is not finite or farther than any map.
    pub rejected: usize,
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellState {
    /// Nothing, or too little.
    Unknown,
    /// Beams pass.
    Free,
    /// Something stands there.
    Occupied,
}

/// The grid.
#[derive(Clone, Debug)]
pub struct Grid {
    config: randt_config::Grid,
    tiles: BTreeMap<TileIndex, Tile>,
    /// Versions in which tiles became empty.
    gone: BTreeMap<TileIndex, u64>,
    /// Where each keyframe is painted.
    placed: BTreeMap<u64, LatticePose>,
    version: u64,
    stencil: Stencil,
}

impl Grid {
    /// Nothing is known yet.
    pub fn new(config: &randt_config::Grid) -> Self {
        Self {
            config: config.clone(),
            tiles: BTreeMap::new(),
            gone: BTreeMap::new(),
            placed: BTreeMap::new(),
            version: 0,
            stencil: Stencil::default(),
        }
    }

    /// Puts keyframes where they are now. Those that have not moved by a part of a cell cost nothing.
    pub fn update<'a>(
        &mut self,
        keyframes: impl IntoIterator<Item = GridKeyframe<'a>>,
    ) -> GridUpdate {
        let mut update = GridUpdate::default();
        for keyframe in keyframes {
            let new = LatticePose::of(&keyframe.pose, self.config.cell_size_m);
            let old = match new {
                Some(new) => self.placed.insert(keyframe.id, new),
                None => self.placed.remove(&keyframe.id),
            };
            match (old, new) {
                _ if old == new => {}
                (None, _) => update.added += 1,
                (Some(_), Some(_)) => update.moved += 1,
                (Some(_), None) => update.removed += 1,
            }
            update.rejected += usize::from(new.is_none());
            self.repaint(&keyframe, old, new);
        }
        self.finish();
        update
    }

    /// Takes keyframes out, wherever they are.
    pub fn remove<'a>(
        &mut self,
        keyframes: impl IntoIterator<Item = GridKeyframe<'a>>,
    ) -> GridUpdate {
        let mut update = GridUpdate::default();
        for keyframe in keyframes {
            let old = self.placed.remove(&keyframe.id);
            update.removed += usize::from(old.is_some());
            self.repaint(&keyframe, old, None);
        }
        self.finish();
        update
    }

    /// Rises with every update that changed a tile.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Edge of a cell, m.
    pub fn cell_size_m(&self) -> f64 {
        self.config.cell_size_m
    }

    /// The tiles that hold something, by index.
    pub fn tiles(&self) -> impl Iterator<Item = (TileIndex, &Tile)> {
        self.tiles.iter().map(|(&index, tile)| (index, tile))
    }

    /// What has changed after a version: tiles with their new content, `None` for those that are empty now.
    pub fn changed_since(&self, version: u64) -> impl Iterator<Item = (TileIndex, Option<&Tile>)> {
        let changed = self.tiles().filter(move |(_, tile)| tile.version > version);
        let gone = self.gone.iter().filter(move |(_, then)| **then > version);
        changed
            .map(|(index, tile)| (index, Some(tile)))
            .chain(gone.map(|(&index, _)| (index, None)))
    }

    /// What the counters of a cell mean.
    pub fn state(&self, count: CellCount) -> CellState {
        let hits = f64::from(count.hits);
        let sum = hits + f64::from(count.misses);
        if count.hits >= self.config.hits_min && hits >= self.config.occupied_share * sum {
            CellState::Occupied
        } else if count.misses >= self.config.misses_min && hits < self.config.occupied_share * sum
        {
            CellState::Free
        } else {
            CellState::Unknown
        }
    }

    /// The grid as a picture that a planner reads; `None` when it is wider than any picture should be.
    pub fn picture(&self) -> Option<Picture> {
        Picture::of(self)
    }

    fn repaint(
        &mut self,
        keyframe: &GridKeyframe<'_>,
        old: Option<LatticePose>,
        new: Option<LatticePose>,
    ) {
        if old == new {
            return;
        }
        let cell_size_m = self.config.cell_size_m;
        for (pose, change) in [(old, Change::Remove), (new, Change::Add)] {
            if let Some(pose) = pose {
                let rays = ray::rays(keyframe, cell_size_m);
                self.stencil.paint(rays, &pose.placement());
                self.count(change);
            }
        }
    }

    /// Adds the stencil's votes to the tiles under it, or takes them out.
    fn count(&mut self, change: Change) {
        let edge = TILE_CELLS as i32;
        let [width, height] = self.stencil.size;
        let [left, bottom] = self.stencil.corner;
        if width == 0 {
            return;
        }
        let (right, top) = (left + width as i32, bottom + height as i32);
        for y in bottom.div_euclid(edge)..=(top - 1).div_euclid(edge) {
            for x in left.div_euclid(edge)..=(right - 1).div_euclid(edge) {
                let from = [left.max(x * edge), bottom.max(y * edge)];
                let to = [right.min((x + 1) * edge), top.min((y + 1) * edge)];
                let columns = (from[0] - left) as usize..(to[0] - left) as usize;
                let rows = from[1]..to[1];
                let votes = |row: i32| self.stencil.row((row - bottom) as usize, columns.clone());
                let is_vote = |&vote: &u8| vote != NONE;
                if !rows.clone().any(|row| votes(row).iter().any(is_vote)) {
                    continue;
                }
                let tile = self.tiles.entry(TileIndex { y, x }).or_default();
                tile.version = self.version + 1;
                for row in rows {
                    let (column, line) = ((from[0] - x * edge) as usize, (row - y * edge) as usize);
                    tile.count(column, line, votes(row), change);
                }
            }
        }
    }

    /// Ends an update: empty tiles go, the version rises if anything has changed.
    fn finish(&mut self) {
        let next = self.version + 1;
        let mut is_changed = false;
        self.tiles.retain(|index, tile| {
            let is_new = tile.version == next;
            is_changed |= is_new;
            let is_empty = is_new && tile.is_empty();
            if is_empty {
                self.gone.insert(*index, next);
            } else if is_new {
                self.gone.remove(index);
            }
            !is_empty
        });
        self.version += u64::from(is_changed);
    }
}

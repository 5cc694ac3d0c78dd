//! The occupancy grid: where keyframes' beams passed and where they ended.
//!
//! Responsible for counters that follow the graph. Every keyframe's votes can be taken out at its
//! old pose and put in at its new one, to the last bit: the grid is a function of the keyframes
//! and where they are now, not of the order or the way in which they came there. Not responsible
//! for keeping keyframes, for poses, nor for files.

mod lattice;
mod pgm;
mod ray;
mod stencil;
#[cfg(test)]
mod tests;
mod tile;
mod tiles;

pub use pgm::Picture;
pub use tile::{CellCount, TILE_CELLS, Tile, TileIndex};

use crate::index::KeyframeIdx;
use crate::keyframe::{LazyObservation, MapKeyframe};
use crate::pose_graph::KeyframeGraph;
use lattice::LatticePose;
use randt_geometry::Pose2;
use ray::RayMaker;
use std::collections::BTreeMap;
use stencil::Stencil;
use tile::Change;
use tiles::Tiles;

/// A keyframe as the grid needs it. What belongs to an id never changes but for the pose.
#[derive(Clone, Copy, Debug)]
pub struct GridKeyframe<'a> {
    /// Its number.
    pub id: u64,
    /// `base_link` at the sweep's end in the map.
    pub map_from_base: Pose2,
    /// What was seen from there.
    pub observation: &'a LazyObservation,
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
    /// Keyframes that cannot be painted: their pose is not finite or farther than any map.
    pub rejected: usize,
    /// Keyframes that are left for the next update.
    pub left: usize,
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
    tiles: Tiles,
    /// Where each keyframe is painted.
    painted: BTreeMap<u64, LatticePose>,
    rays: RayMaker,
    stencil: Stencil,
}

impl Grid {
    /// Nothing is known yet.
    pub fn new(config: &randt_config::Grid) -> Self {
        Self {
            config: config.clone(),
            tiles: Tiles::default(),
            painted: BTreeMap::new(),
            rays: RayMaker::new(config.cell_size_m),
            stencil: Stencil::default(),
        }
    }

    /// Brings the grid up to the keyframes of the largest component and where they are now, of
    /// those at one node of the graph the newest; all others are taken out. After `paintings_max`
    /// the others are left as they are: a keyframe that has moved is painted twice.
    pub(crate) fn follow(
        &mut self,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
        paintings_max: usize,
    ) -> GridUpdate {
        let component = graph.largest_component();
        let all = keyframes.iter().zip(graph.poses()).enumerate();
        let all = all.map(|(index, (keyframe, map_from_base))| {
            let painted = GridKeyframe {
                id: keyframe.keyframe_id,
                map_from_base: *map_from_base,
                observation: &keyframe.observation,
            };
            let keyframe = KeyframeIdx(index);
            let is_of_map = graph.component_of(keyframe) == component;
            (is_of_map && graph.shows(keyframe), painted)
        });
        let (mut keep, mut leave) = (Vec::new(), Vec::new());
        for (is_kept, painted) in all {
            if is_kept { &mut keep } else { &mut leave }.push(painted);
        }
        let (mut paintings, mut left) = (0, 0);
        let mut is_now = |count: usize| {
            // One is always painted, however few are wanted.
            let is_now = count == 0 || paintings == 0 || paintings + count <= paintings_max;
            paintings += if is_now { count } else { 0 };
            left += usize::from(!is_now);
            is_now
        };
        leave.retain(|keyframe| is_now(usize::from(self.painted.contains_key(&keyframe.id))));
        keep.retain(|keyframe| is_now(self.paintings(keyframe)));
        let removed = self.remove(&leave);
        let mut update = self.update(&keep);
        update.removed += removed;
        update.left = left;
        update
    }

    /// Puts keyframes where they are now; others stay where they are. One that has not moved by a
    /// part of a cell costs nothing. All keyframes in order of their ids are done in half the time
    /// when most have moved.
    pub fn update(&mut self, keyframes: &[GridKeyframe<'_>]) -> GridUpdate {
        let mut update = GridUpdate::default();
        let is_anew = self.is_cheaper_anew(keyframes);
        let before = match is_anew {
            true => self.tiles.take(),
            false => BTreeMap::new(),
        };
        for keyframe in keyframes {
            let new = self.lattice(keyframe);
            let old = match new {
                Some(new) => self.painted.insert(keyframe.id, new),
                None => self.painted.remove(&keyframe.id),
            };
            update.rejected += usize::from(new.is_none());
            match (old, new) {
                _ if old == new => {}
                (None, _) => update.added += 1,
                (Some(_), Some(_)) => update.moved += 1,
                (Some(_), None) => update.removed += 1,
            }
            if is_anew {
                self.paint(keyframe, None, new);
            } else if old != new {
                self.paint(keyframe, old, new);
            }
        }
        self.tiles.finish(&before);
        update
    }

    /// How often a keyframe has to be painted: at its new pose, and to take it out at its old one.
    fn paintings(&self, keyframe: &GridKeyframe<'_>) -> usize {
        let (old, new) = (self.painted.get(&keyframe.id), self.lattice(keyframe));
        match old.copied() == new {
            true => 0,
            false => usize::from(old.is_some()) + usize::from(new.is_some()),
        }
    }

    /// Takes keyframes out, wherever they are; gives how many there were.
    pub fn remove(&mut self, keyframes: &[GridKeyframe<'_>]) -> usize {
        let mut removed = 0;
        for keyframe in keyframes {
            // What was never painted is not even unpacked.
            if let Some(old) = self.painted.remove(&keyframe.id) {
                removed += 1;
                self.paint(keyframe, Some(old), None);
            }
        }
        self.tiles.finish(&BTreeMap::new());
        removed
    }

    /// Rises with every update that changed a tile.
    pub fn version(&self) -> u64 {
        self.tiles.version
    }

    /// Edge of a cell, m.
    pub fn cell_size_m(&self) -> f64 {
        self.config.cell_size_m
    }

    /// The tiles that hold something, by index.
    pub fn tiles(&self) -> impl Iterator<Item = (TileIndex, &Tile)> {
        self.tiles.iter()
    }

    /// A tile; `None` where nothing is known.
    pub fn tile(&self, index: TileIndex) -> Option<&Tile> {
        self.tiles.get(index)
    }

    /// Version in which a tile last changed, or became empty; 0 where there never was one.
    pub fn changed_at(&self, index: TileIndex) -> u64 {
        self.tiles.changed_at(index)
    }

    /// What has changed after a version: tiles with their new content, `None` for those that are
    /// empty now.
    pub fn changed_since(&self, version: u64) -> impl Iterator<Item = (TileIndex, Option<&Tile>)> {
        let tiles = self.tiles().map(|(index, tile)| (index, Some(tile)));
        let changed =
            tiles.filter(move |(_, tile)| tile.is_some_and(|tile| tile.version > version));
        changed.chain(self.tiles.gone_since(version).map(|index| (index, None)))
    }

    /// What the counters of a cell mean.
    pub fn state(&self, count: CellCount) -> CellState {
        let hits = f64::from(count.hits);
        let occupied_min = self.config.occupied_share * (hits + f64::from(count.misses));
        if count.hits >= self.config.hits_min && hits >= occupied_min {
            CellState::Occupied
        } else if count.misses >= self.config.misses_min && hits < occupied_min {
            CellState::Free
        } else {
            CellState::Unknown
        }
    }

    /// The grid as a picture that a planner reads; `None` when it is wider than any picture should
    /// be.
    pub fn picture(&self) -> Option<Picture> {
        Picture::from_grid(self)
    }

    fn lattice(&self, keyframe: &GridKeyframe<'_>) -> Option<LatticePose> {
        LatticePose::nearest(&keyframe.map_from_base, self.config.cell_size_m)
    }

    /// Whether these are all keyframes, each once, and most have moved: then painting each of them
    /// once on nothing is less than taking out and painting the ones that moved.
    fn is_cheaper_anew(&self, keyframes: &[GridKeyframe<'_>]) -> bool {
        let (mut known, mut moved) = (0, 0);
        for keyframe in keyframes {
            if let Some(&old) = self.painted.get(&keyframe.id) {
                known += 1;
                moved += usize::from(self.lattice(keyframe) != Some(old));
            }
        }
        known == self.painted.len()
            && 2 * moved > known
            && keyframes.is_sorted_by(|a, b| a.id < b.id)
    }

    /// Takes a keyframe's votes out at one pose and puts them in at another.
    fn paint(
        &mut self,
        keyframe: &GridKeyframe<'_>,
        old: Option<LatticePose>,
        new: Option<LatticePose>,
    ) {
        let rays = self.rays.make(keyframe.observation);
        for (pose, change) in [(old, Change::Remove), (new, Change::Add)] {
            if let Some(pose) = pose {
                self.stencil.paint(rays, &pose.placement());
                self.tiles.count(&self.stencil, change);
            }
        }
    }
}

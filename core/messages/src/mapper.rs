//! `mapper/correction`, `mapper/graph`, `mapper/grid`: the global map as it becomes known.

use crate::{Header, layout::coded, plain};

/// Cells along an edge of a tile of the occupancy grid.
pub const TILE_CELLS: usize = 64;
/// Most entries in one message of the graph; larger graphs come in pages.
pub const GRAPH_ENTRIES_MAX: usize = 1024;

coded! {
    /// What an entry of the graph is.
    pub enum GraphEntryKind {
        /// A keyframe and where it stands.
        #[default]
        Node = 0 => "node",
        /// A loop that is in force.
        Loop = 1 => "loop",
    }
}

plain! {
    /// Where `odom` lies in `map`, as of a version of the graph.
    pub struct Correction {
        /// Stamp: that of the newest keyframe.
        pub header: Header,
        /// Rises with every change of the map.
        pub graph_version: u64,
        /// The odometry frame whose pose this is.
        pub odom_frame_id: u64,
        /// First `odom_frame_id` of the component of the pose graph that it belongs to. No edge
        /// joins two components.
        #[was(part)]
        pub component: u64,
        /// Pose of `odom` in `map`: x m, y m, yaw rad.
        #[was(pose)]
        pub map_from_odom: [f64; 3],
    }

    /// The fixed part of a message of the graph.
    pub struct GraphHead {
        /// Stamp: that of the newest keyframe.
        pub header: Header,
        /// Rises with every change of the map.
        pub graph_version: u64,
        /// Keyframes in the graph.
        pub keyframes: u64,
        /// The keyframe that the mapper waits for: one more than the newest that it has, 0 where
        /// it has none.
        pub wanted_keyframe: u64,
        /// Keyframes below this number are on disk and need not be kept by anybody else.
        pub on_disk: u64,
        /// Odometry frame of the newest keyframe.
        pub odom_frame_id: u64,
        /// Loops in force.
        pub loops: u64,
        /// Loops that confirm the graph and cost no edge.
        pub confirmed_loops: u64,
        /// Components of the pose graph.
        #[was(parts)]
        pub components: u64,
        /// Path over all keyframes, m.
        pub path_m: f64,
        /// Tiles of the occupancy grid.
        pub tiles: u64,
        /// Number of the first entry in this message among those of this version.
        pub first_entry: u32,
        /// Whether keyframes from `wanted_keyframe` on shall be sent again: 1 or 0.
        pub send_again: u32,
    }

    /// A node or a loop.
    pub struct GraphEntry {
        /// Node: the keyframe. Loop: the older keyframe.
        pub a: u64,
        /// Node: the first keyframe of its component. Loop: the newer keyframe.
        pub b: u64,
        /// Stamp of the keyframe; 0 for a loop.
        pub stamp_ns: i64,
        /// Node: in `map`. Loop: the newer keyframe seen from the older one. x m, y m, yaw rad.
        pub pose: [f64; 3],
        /// Loop: how far it is believed, 0..1; 1 for a node.
        pub weight: f32,
        /// A [`GraphEntryKind`] as its code.
        #[code(GraphEntryKind)]
        pub kind: u32,
    }

    /// The fixed part of a tile of the occupancy grid; its cells follow row by row from the lower
    /// left one: 0 free to 100 occupied, 255 unknown.
    pub struct TileHead {
        /// Stamp: that of the newest keyframe.
        pub header: Header,
        /// Version of the grid in which the tile last changed.
        pub grid_version: u64,
        /// Column of the tile, to the right.
        pub column: i32,
        /// Row of the tile, upwards; cell (0, 0) is the lower left one of tile (0, 0) and has its
        /// corner at the origin.
        pub row: i32,
        /// Edge of a cell, m.
        pub resolution_m: f64,
    }
}

//! The messages of a mapper, filled. Sequence, epoch and time of publishing are the publisher's.

use crate::Mapper;
use crate::index::KeyframeIdx;
use crate::occupancy::{CellState, TileIndex};
use crate::verification::LoopStatus;
use randt_messages::{
    Correction, GRAPH_ENTRIES_MAX, GraphEntry, GraphEntryKind, Header, MapperGraph, MapperGrid,
    Message, TILE_CELLS,
};

/// A cell as [`MapperGrid`] has it, and `map.pgm` with other grey values.
const FREE: u8 = 0;
const OCCUPIED: u8 = 100;
const UNKNOWN: u8 = 255;

/// Where `odom` lies in `map`, for the frame of the newest keyframe; `None` before there is one.
pub fn correction(mapper: &Mapper) -> Option<Correction> {
    let keyframe = mapper.keyframes().last()?;
    let map_from_base = mapper.poses().last()?;
    let map_from_odom = map_from_base.compose(&keyframe.odom_from_base.inverse());
    let newest = KeyframeIdx(mapper.keyframes().len() - 1);
    let first = mapper.component_of(newest).first_keyframe();
    Some(Correction {
        header: header(mapper),
        graph_version: mapper.version(),
        odom_frame_id: keyframe.odom_frame_id,
        component: mapper.keyframes().get(first.0)?.odom_frame_id,
        map_from_odom: map_from_odom.to_array(),
    })
}

/// Fills a message with the graph's summary and its entries from one on: nodes, then loops. Gives
/// the first entry of the next message, `None` after the last. What the mapper does not know (what
/// is on the disk, whether keyframes shall be sent again) is left as it was.
pub fn fill_graph(
    mapper: &Mapper,
    first_entry: usize,
    message: &mut Message<MapperGraph>,
) -> Option<usize> {
    let (keyframes, loops) = (mapper.keyframes(), mapper.graph_loops());
    let head = &mut *message.head;
    head.header = header(mapper);
    head.graph_version = mapper.version();
    head.keyframes = keyframes.len() as u64;
    let newest = keyframes.last();
    head.wanted_keyframe = newest.map_or(0, |keyframe| keyframe.keyframe_id.saturating_add(1));
    head.odom_frame_id = newest.map_or(0, |keyframe| keyframe.odom_frame_id);
    head.loops = loops.len() as u64;
    let found = mapper.closures().iter().map(|closure| closure.status);
    let is_confirmed = |status: &LoopStatus| *status == LoopStatus::Confirmed;
    head.confirmed_loops = found.filter(is_confirmed).count() as u64;
    head.components = mapper.components() as u64;
    head.path_m = mapper.path_m();
    head.tiles = mapper.grid().tiles().count() as u64;
    head.first_entry = first_entry as u32;

    message.items.clear();
    let nodes = (first_entry..keyframes.len()).filter_map(|index| node(mapper, index));
    let loops_from = first_entry.saturating_sub(keyframes.len());
    let edges = (loops_from..loops.len()).filter_map(|index| edge(mapper, index));
    let entries = nodes.chain(edges).take(GRAPH_ENTRIES_MAX);
    message.items.extend(entries);
    let next = first_entry + message.items.len();
    (next < keyframes.len() + loops.len()).then_some(next)
}

fn node(mapper: &Mapper, index: usize) -> Option<GraphEntry> {
    let keyframe = mapper.keyframes().get(index)?;
    let first = mapper.component_of(KeyframeIdx(index)).first_keyframe();
    Some(GraphEntry {
        a: keyframe.keyframe_id,
        b: keyframe_id(mapper, first)?,
        stamp_ns: keyframe.stamp_ns,
        pose: mapper.poses().get(index)?.to_array(),
        weight: 1.0,
        kind: GraphEntryKind::Node as u32,
    })
}

fn edge(mapper: &Mapper, index: usize) -> Option<GraphEntry> {
    let found = mapper.graph_loops().get(index)?;
    Some(GraphEntry {
        a: keyframe_id(mapper, found.edge.from)?,
        b: keyframe_id(mapper, found.edge.to)?,
        stamp_ns: 0,
        pose: found.edge.measured.to_array(),
        weight: found.weight as f32,
        kind: GraphEntryKind::Loop as u32,
    })
}

fn keyframe_id(mapper: &Mapper, index: KeyframeIdx) -> Option<u64> {
    Some(mapper.keyframes().get(index.0)?.keyframe_id)
}

/// Lists the tiles that changed after a version of the grid, those that changed first in front.
/// Gives the version to ask from next, once all of these are published.
pub fn list_tiles(mapper: &Mapper, version: u64, out: &mut Vec<TileIndex>) -> u64 {
    let grid = mapper.grid();
    out.clear();
    out.extend(grid.changed_since(version).map(|(index, _)| index));
    out.sort_unstable_by_key(|index| (grid.changed_at(*index), *index));
    grid.version()
}

/// Fills a message with a tile as it is now; all is unknown where it has become empty.
pub fn fill_tile(mapper: &Mapper, index: TileIndex, message: &mut Message<MapperGrid>) {
    let grid = mapper.grid();
    let head = &mut *message.head;
    head.header = header(mapper);
    head.grid_version = grid.changed_at(index);
    (head.column, head.row) = (index.x, index.y);
    head.resolution_m = grid.cell_size_m();
    message.items.clear();
    let tile = grid.tile(index);
    let cells = tile.into_iter().flat_map(|tile| tile.cells());
    let states = cells.map(|count| match grid.state(count) {
        CellState::Free => FREE,
        CellState::Occupied => OCCUPIED,
        CellState::Unknown => UNKNOWN,
    });
    message.items.extend(states);
    message.items.resize(TILE_CELLS * TILE_CELLS, UNKNOWN);
}

/// All that the mapper knows of a header: the newest keyframe's stamp.
fn header(mapper: &Mapper) -> Header {
    let newest = mapper.keyframes().last();
    Header {
        stamp_ns: newest.map_or(0, |keyframe| keyframe.stamp_ns),
        ..Header::default()
    }
}

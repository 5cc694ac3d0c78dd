//! `Grid`: the occupancy grid, put together from its tiles.

use super::{MAP, pose_of, timestamp};
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Grid, PackedElementField, Vector2};
use randt_messages::{MapperGrid, Message, TILE_CELLS};
use std::collections::BTreeMap;

/// A grid that changes is shown so often ...
const PERIOD_NS: i64 = 2_000_000_000;
/// ... or as seldom as a large one needs, so that it takes no more than this before compression, ...
const BYTES_PER_SECOND: i64 = 500_000;
/// ... but whole each minute, changed or not.
const PERIOD_MAX_NS: i64 = 60_000_000_000;
/// Red, green, blue, alpha: viewers show it without being told how.
const STRIDE: usize = 4;
const UNKNOWN: u8 = 255;

/// All tiles that were ever heard of.
#[derive(Debug, Default)]
pub(super) struct Tiles {
    /// By row, then column, with their cells.
    tiles: BTreeMap<(i32, i32), Box<[u8]>>,
    cell_m: f64,
    has_changed: bool,
    drawn_ns: Option<i64>,
}

impl Tiles {
    /// Takes a tile as it now is.
    pub(super) fn take(&mut self, tile: Message<MapperGrid>) {
        if tile.items.len() != TILE_CELLS * TILE_CELLS {
            return;
        }
        self.cell_m = tile.head.resolution_m;
        self.has_changed = true;
        let place = (tile.head.row, tile.head.column);
        self.tiles.insert(place, tile.items.into_boxed_slice());
    }

    /// The next one is due at once.
    pub(super) fn begin_anew(&mut self) {
        self.drawn_ns = None;
    }

    /// The whole grid, where it is time to show it.
    pub(super) fn due(&mut self, now_ns: i64, stamp_ns: i64) -> Option<Grid> {
        let extent = self.extent()?;
        let paced_ns = extent.bytes().saturating_mul(1_000_000_000) / BYTES_PER_SECOND;
        let pause_ns = match self.has_changed {
            true => paced_ns.clamp(PERIOD_NS, PERIOD_MAX_NS),
            false => PERIOD_MAX_NS,
        };
        // A clock that jumps back is no reason to wait.
        if self
            .drawn_ns
            .is_some_and(|drawn_ns| (0..pause_ns).contains(&(now_ns - drawn_ns)))
        {
            return None;
        }
        self.drawn_ns = Some(now_ns);
        self.has_changed = false;
        Some(self.draw(&extent, stamp_ns))
    }

    fn extent(&self) -> Option<Extent> {
        let columns = || self.tiles.keys().map(|(_, column)| *column);
        let (first_row, last_row) = (self.tiles.keys().next()?.0, self.tiles.keys().last()?.0);
        let (first_column, last_column) = (columns().min()?, columns().max()?);
        let extent = Extent {
            row: first_row,
            column: first_column,
            rows: usize::try_from(i64::from(last_row) - i64::from(first_row) + 1).ok()?,
            columns: usize::try_from(i64::from(last_column) - i64::from(first_column) + 1).ok()?,
        };
        // Two parts of a map that lie a world apart are not put on one sheet.
        (extent.bytes() <= BYTES_MAX).then_some(extent)
    }

    fn draw(&self, extent: &Extent, stamp_ns: i64) -> Grid {
        let width = extent.columns * TILE_CELLS;
        let mut data = vec![0; width * extent.rows * TILE_CELLS * STRIDE];
        for ((row, column), cells) in &self.tiles {
            let x = (*column - extent.column) as usize * TILE_CELLS;
            let y = (*row - extent.row) as usize * TILE_CELLS;
            for (line, cells) in (y..).zip(cells.chunks_exact(TILE_CELLS)) {
                let begin = (line * width + x) * STRIDE;
                let pixels = data.iter_mut().skip(begin);
                let colours = cells.iter().flat_map(|cell| colour(*cell));
                pixels.zip(colours).for_each(|(to, from)| *to = from);
            }
        }
        let tile_m = self.cell_m * TILE_CELLS as f64;
        let corner = [extent.column, extent.row].map(|tiles| f64::from(tiles) * tile_m);
        Grid {
            timestamp: timestamp(stamp_ns),
            frame_id: MAP.to_owned(),
            pose: Some(pose_of([corner[0], corner[1], 0.0])),
            column_count: width as u32,
            cell_size: Some(Vector2 {
                x: self.cell_m,
                y: self.cell_m,
            }),
            row_stride: (width * STRIDE) as u32,
            cell_stride: STRIDE as u32,
            fields: ["red", "green", "blue", "alpha"]
                .iter()
                .zip(0..)
                .map(|(name, offset)| PackedElementField {
                    name: (*name).to_owned(),
                    offset,
                    r#type: NumericType::Uint8 as i32,
                })
                .collect(),
            data: data.into(),
        }
    }
}

/// A kilometre square of cells of 0.1 m is 400 MB: whatever is larger has gone wrong, and no viewer shows it.
const BYTES_MAX: i64 = 64 << 20;

/// The tiles' rectangle.
struct Extent {
    row: i32,
    column: i32,
    rows: usize,
    columns: usize,
}

impl Extent {
    fn bytes(&self) -> i64 {
        let tiles = self.rows.saturating_mul(self.columns);
        i64::try_from(tiles.saturating_mul(TILE_CELLS * TILE_CELLS * STRIDE)).unwrap_or(i64::MAX)
    }
}

/// Free is light, occupied dark, unknown not there.
fn colour(cell: u8) -> [u8; STRIDE] {
    match cell {
        UNKNOWN => [0; STRIDE],
        occupied => {
            let light = 240 - 2 * occupied.min(100);
            [light, light, light, 255]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(row: i32, column: i32, cell: u8) -> Message<MapperGrid> {
        let mut tile = Message::<MapperGrid>::default();
        (tile.head.row, tile.head.column) = (row, column);
        tile.head.resolution_m = 0.1;
        tile.items = vec![cell; TILE_CELLS * TILE_CELLS];
        tile
    }

    #[test]
    fn tiles_lie_where_they_belong() {
        let mut tiles = Tiles::default();
        assert!(tiles.due(0, 0).is_none());
        tiles.take(tile(-1, 2, 100));
        tiles.take(tile(0, 1, 0));
        let grid = tiles.due(0, 0).unwrap();
        assert_eq!(grid.column_count, 128);
        let corner = grid.pose.unwrap().position.unwrap();
        assert!((corner.x - 6.4).abs() < 1e-12 && (corner.y + 6.4).abs() < 1e-12);
        let pixel = |x: usize, y: usize| &grid.data[(y * 128 + x) * 4..][..4];
        assert_eq!(pixel(64, 0), [40, 40, 40, 255]);
        assert_eq!(pixel(0, 64), [240, 240, 240, 255]);
        assert_eq!(pixel(0, 63), [0; 4]);
        assert_eq!(pixel(127, 127), [0; 4]);
    }

    #[test]
    fn it_is_shown_when_it_changes_each_minute_and_in_each_file() {
        let mut tiles = Tiles::default();
        let s = 1_000_000_000;
        tiles.take(tile(0, 0, 0));
        assert!(tiles.due(0, 0).is_some() && tiles.due(10 * s, 0).is_none());
        tiles.take(tile(0, 0, 50));
        assert!(tiles.due(s, 0).is_none() && tiles.due(2 * s, 0).is_some());
        assert!(tiles.due(61 * s, 0).is_none() && tiles.due(62 * s, 0).is_some());
        tiles.begin_anew();
        assert!(tiles.due(63 * s, 0).is_some());
    }
}

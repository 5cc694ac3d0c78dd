//! `Grid`: the occupancy grid, put together from its tiles.

use crate::{MAP, packed_fields, pose_of, timestamp};
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Grid, Vector2};
use randt_messages::{MapperGrid, Message, TILE_CELLS};
use std::collections::BTreeMap;

/// Red, green, blue, alpha: viewers show it without any settings.
const STRIDE: usize = 4;
const UNKNOWN: u8 = 255;

/// All tiles that ever came.
#[derive(Debug, Default)]
pub struct Tiles {
    /// By row, then column, with their cells.
    tiles: BTreeMap<(i32, i32), Box<[u8]>>,
    cell_m: f64,
}

impl Tiles {
    /// Takes a tile as it now is.
    pub fn take(&mut self, tile: Message<MapperGrid>) {
        if tile.items.len() != TILE_CELLS * TILE_CELLS {
            return;
        }
        self.cell_m = tile.head.resolution_m;
        let index = (tile.head.row, tile.head.column);
        self.tiles.insert(index, tile.items.into_boxed_slice());
    }

    /// Bytes of the whole grid as a message; `None` where there is none, or one that no viewer
    /// could show.
    pub fn size(&self) -> Option<i64> {
        self.extent().map(|extent| extent.bytes())
    }

    /// The whole grid.
    pub fn draw(&self, stamp_ns: i64) -> Option<Grid> {
        self.extent().map(|extent| self.draw_on(&extent, stamp_ns))
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
        // Two components of a map that lie far apart are not put into one grid.
        (extent.bytes() <= BYTES_MAX).then_some(extent)
    }

    fn draw_on(&self, extent: &Extent, stamp_ns: i64) -> Grid {
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
            fields: packed_fields(&["red", "green", "blue", "alpha"], NumericType::Uint8, 1),
            data: data.into(),
        }
    }
}

/// A kilometre square of cells of 0.1 m is 400 MB: whatever is larger has gone wrong, and no
/// viewer shows it.
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
        assert!(tiles.draw(0).is_none());
        tiles.take(tile(-1, 2, 100));
        tiles.take(tile(0, 1, 0));
        let grid = tiles.draw(0).unwrap();
        assert_eq!(grid.column_count, 128);
        let corner = grid.pose.unwrap().position.unwrap();
        assert!((corner.x - 6.4).abs() < 1e-12 && (corner.y + 6.4).abs() < 1e-12);
        let pixel = |x: usize, y: usize| &grid.data[(y * 128 + x) * 4..][..4];
        assert_eq!(pixel(64, 0), [40, 40, 40, 255]);
        assert_eq!(pixel(0, 64), [240, 240, 240, 255]);
        assert_eq!(pixel(0, 63), [0; 4]);
        assert_eq!(pixel(127, 127), [0; 4]);
    }
}

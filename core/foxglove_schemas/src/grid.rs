//! The occupancy grid, put together from its tiles, and as a `Grid`.

use crate::{MAP, packed_fields, pose_of, timestamp};
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Grid, Vector2};
use randt_messages::{MapperGrid, Message, TILE_CELLS};
use randt_ros_messages::Cells;
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

    /// The whole grid as a picture.
    pub fn draw(&self, stamp_ns: i64) -> Option<Grid> {
        self.cells().map(|cells| picture(&cells, stamp_ns))
    }

    /// The whole grid.
    pub fn cells(&self) -> Option<Cells> {
        self.extent().map(|extent| self.cells_on(&extent))
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

    fn cells_on(&self, extent: &Extent) -> Cells {
        let width = extent.columns * TILE_CELLS;
        let mut values = vec![UNKNOWN; width * extent.rows * TILE_CELLS];
        for ((row, column), cells) in &self.tiles {
            let x = (*column - extent.column) as usize * TILE_CELLS;
            let y = (*row - extent.row) as usize * TILE_CELLS;
            for (line, cells) in (y..).zip(cells.chunks_exact(TILE_CELLS)) {
                let begin = line * width + x;
                if let Some(to) = values.get_mut(begin..begin + TILE_CELLS) {
                    to.copy_from_slice(cells);
                }
            }
        }
        let tile_m = self.cell_m * TILE_CELLS as f64;
        Cells {
            cell_m: self.cell_m,
            corner_m: [extent.column, extent.row].map(|tiles| f64::from(tiles) * tile_m),
            width,
            values,
        }
    }
}

fn picture(cells: &Cells, stamp_ns: i64) -> Grid {
    let data: Vec<u8> = cells.values.iter().flat_map(|cell| colour(*cell)).collect();
    let [x_m, y_m] = cells.corner_m;
    Grid {
        timestamp: timestamp(stamp_ns),
        frame_id: MAP.to_owned(),
        pose: Some(pose_of([x_m, y_m, 0.0])),
        column_count: cells.width as u32,
        cell_size: Some(Vector2 {
            x: cells.cell_m,
            y: cells.cell_m,
        }),
        row_stride: (cells.width * STRIDE) as u32,
        cell_stride: STRIDE as u32,
        fields: packed_fields(&["red", "green", "blue", "alpha"], NumericType::Uint8, 1),
        data: data.into(),
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
        let cells = tiles.cells().unwrap();
        assert_eq!((cells.width, cells.values.len()), (128, 128 * 128));
        assert_eq!((cells.values[64], cells.values[64 * 128]), (100, 0));
        assert_eq!((cells.values[0], cells.corner_m[0]), (255, corner.x));
        let pixel = |x: usize, y: usize| &grid.data[(y * 128 + x) * 4..][..4];
        assert_eq!(pixel(64, 0), [40, 40, 40, 255]);
        assert_eq!(pixel(0, 64), [240, 240, 240, 255]);
        assert_eq!(pixel(0, 63), [0; 4]);
        assert_eq!(pixel(127, 127), [0; 4]);
    }
}

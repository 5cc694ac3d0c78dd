//! The grid as Nav2's map_server reads it: `map.pgm` and `map.yaml`. Only bytes; files are written elsewhere.

use super::{CellState, Grid, TILE_CELLS, Tile, TileIndex};
use std::fmt::Write;

/// Grey values of map_server's trinary mode.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;
/// A picture of more pixels is refused: 16,384 x 16,384, 1.6 km a side with cells of 0.1 m.
const PIXELS_MAX: u64 = 1 << 28;
/// map_server calls a pixel occupied when its darkness is above the first and free when it is below the second.
const OCCUPIED_THRESHOLD: f64 = 0.65;
const FREE_THRESHOLD: f64 = 0.25;

/// The grid as grey pixels, from the smallest to the largest cell that is free or occupied.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in x.
    pub width: usize,
    /// Pixels in y.
    pub height: usize,
    /// Edge of a pixel, m.
    pub resolution_m: f64,
    /// Lower left corner of the lower left pixel in the map, m.
    pub origin_m: [f64; 2],
    /// Row by row; the first row is the one of largest y.
    pub pixels: Vec<u8>,
}

impl Picture {
    /// Of a grid; one unknown pixel where nothing is known. `None` where it would be too large.
    pub(crate) fn of(grid: &Grid) -> Option<Self> {
        let (mut least, mut most) = ([i64::MAX; 2], [i64::MIN; 2]);
        each_known(grid, |[x, y], _| {
            least = [least[0].min(x), least[1].min(y)];
            most = [most[0].max(x), most[1].max(y)];
        });
        if least[0] > most[0] {
            (least, most) = ([0; 2], [0; 2]);
        }
        let [width, height] = [0, 1].map(|axis: usize| match axis {
            0 => most[0].abs_diff(least[0]) + 1,
            _ => most[1].abs_diff(least[1]) + 1,
        });
        if width.checked_mul(height)? > PIXELS_MAX {
            return None;
        }
        let mut pixels = vec![UNKNOWN; (width * height) as usize];
        each_known(grid, |[x, y], state| {
            let index = most[1].abs_diff(y) * width + x.abs_diff(least[0]);
            if let Some(pixel) = pixels.get_mut(index as usize) {
                *pixel = match state {
                    CellState::Occupied => OCCUPIED,
                    CellState::Free => FREE,
                    CellState::Unknown => UNKNOWN,
                };
            }
        });
        let resolution_m = grid.cell_size_m();
        Some(Self {
            width: width as usize,
            height: height as usize,
            resolution_m,
            origin_m: least.map(|cell| cell as f64 * resolution_m),
            pixels,
        })
    }

    /// The bytes of `map.pgm`: binary grey, 8 bits.
    pub fn to_pgm(&self) -> Vec<u8> {
        let mut bytes = format!("P5\n{} {}\n255\n", self.width, self.height).into_bytes();
        bytes.extend_from_slice(&self.pixels);
        bytes
    }

    /// The text of `map.yaml` beside a picture of this name.
    pub fn to_yaml(&self, image: &str) -> String {
        let mut text = String::new();
        let [x_m, y_m] = self.origin_m;
        // Writing to a String cannot fail. Nanometres keep 1e7 cells exactly apart and end in no 0.30000000000000004.
        let _ = write!(
            text,
            "image: {image}\nmode: trinary\nresolution: {:.9}\norigin: [{x_m:.9}, {y_m:.9}, 0.0]\nnegate: 0\n\
             occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n",
            self.resolution_m
        );
        text
    }
}

/// Calls for every cell that is free or occupied.
fn each_known(grid: &Grid, mut call: impl FnMut([i64; 2], CellState)) {
    let edge = TILE_CELLS as i64;
    let mut tile_cells = |index: TileIndex, tile: &Tile| {
        let corner = [i64::from(index.x) * edge, i64::from(index.y) * edge];
        for (cell, count) in (0_i64..).zip(tile.cells()) {
            let state = grid.state(count);
            if state != CellState::Unknown {
                call([corner[0] + cell % edge, corner[1] + cell / edge], state);
            }
        }
    };
    grid.tiles()
        .for_each(|(index, tile)| tile_cells(index, tile));
}

//! The grid as Nav2's map_server reads it: `map.pgm` and `map.yaml`. Only bytes; files are written
//! elsewhere.

use super::{CellState, Grid, TILE_CELLS};

/// Grey values of map_server's trinary mode.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;
/// A picture of more pixels is refused: 16,384 x 16,384, 1.6 km a side with cells of 0.1 m.
const PIXELS_MAX: u64 = 1 << 28;
/// map_server calls a pixel occupied when its darkness, (255 - grey) / 255, is above the first and
/// free when it is below the second. Nav2's own default of the second, 0.25, would make 205, with
/// 0.19608, free.
const OCCUPIED_THRESHOLD: f64 = 0.65;
const FREE_THRESHOLD: f64 = 0.196;

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
    /// The picture of a grid; one unknown pixel where nothing is known. `None` where it would be
    /// too large.
    pub(crate) fn from_grid(grid: &Grid) -> Option<Self> {
        let (mut least, mut most) = ([i64::MAX; 2], [i64::MIN; 2]);
        each_known(grid, |[x, y], _| {
            least = [least[0].min(x), least[1].min(y)];
            most = [most[0].max(x), most[1].max(y)];
        });
        if least[0] > most[0] {
            (least, most) = ([0; 2], [0; 2]);
        }
        let width = most[0].abs_diff(least[0]) + 1;
        let height = most[1].abs_diff(least[1]) + 1;
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
        let [x_m, y_m] = self.origin_m;
        // Nanometres keep 1e7 cells exactly apart and end in no 0.30000000000000004.
        format!(
            "image: {image}\nmode: trinary\nresolution: {:.9}\norigin: [{x_m:.9}, {y_m:.9}, 0.0]\nnegate: 0\n\
             occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n",
            self.resolution_m
        )
    }
}

/// Calls for every cell that is free or occupied.
fn each_known(grid: &Grid, mut call: impl FnMut([i64; 2], CellState)) {
    let edge = TILE_CELLS as i64;
    for (index, tile) in grid.tiles() {
        let corner = [i64::from(index.x) * edge, i64::from(index.y) * edge];
        for (cell, count) in (0_i64..).zip(tile.cells()) {
            let state = grid.state(count);
            if state != CellState::Unknown {
                call([corner[0] + cell % edge, corner[1] + cell / edge], state);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::Drawn;
    use super::*;
    use randt_geometry::Pose2;

    /// Reads P5 as map_server does: the grey value at a position of the map, m.
    fn grey_at(pgm: &[u8], yaml: &str, [x_m, y_m]: [f64; 2]) -> u8 {
        let mut fields = pgm.splitn(4, |byte| byte.is_ascii_whitespace());
        let mut number = || str::from_utf8(fields.next().unwrap()).unwrap().to_owned();
        assert_eq!(number(), "P5");
        let [width, height] = [number(), number()].map(|n| n.parse::<usize>().unwrap());
        let rest = fields.next().unwrap();
        let pixels = rest.strip_prefix(b"255\n").unwrap();
        assert_eq!(pixels.len(), width * height);
        let value = |key: &str| {
            let line = yaml.lines().find_map(|line| line.strip_prefix(key));
            line.unwrap().trim().to_owned()
        };
        let resolution: f64 = value("resolution:").parse().unwrap();
        let origin = value("origin:");
        let origin: Vec<f64> = origin
            .trim_matches(['[', ']'])
            .split(',')
            .map(|n| n.trim().parse().unwrap())
            .collect();
        assert_eq!(origin.len(), 3);
        let column = ((x_m - origin[0]) / resolution).floor() as usize;
        let from_below = ((y_m - origin[1]) / resolution).floor() as usize;
        pixels[(height - 1 - from_below) * width + column]
    }

    #[test]
    fn an_asymmetric_shape_is_neither_mirrored_nor_turned() {
        // Three returns, far ahead, nearer to the left, nearest behind to the right, with silent
        // beams between them.
        let (ahead, left, behind) = (
            [(4.05, 0.05, 9.0)],
            [(0.05, 2.05, 9.0)],
            [(-1.05, -0.95, 9.0)],
        );
        let drawn = Drawn::from_clusters([ahead.as_slice(), &[], &left, &[], &behind, &[]]);
        let mut grid = Grid::new(&randt_config::Grid::default());
        let pose = Pose2::new(-7.0, 3.0, 0.0);
        grid.update(&[drawn.at(0, pose), drawn.at(1, pose)]);
        let picture = grid.picture().unwrap();
        let (pgm, yaml) = (picture.to_pgm(), picture.to_yaml("map.pgm"));
        for ([x_m, y_m], expected) in [
            ([4.05, 0.05], OCCUPIED),
            ([0.05, 2.05], OCCUPIED),
            ([-1.05, -0.95], OCCUPIED),
            ([2.0, 0.05], FREE),
            ([0.05, 1.0], FREE),
            ([2.0, 1.5], UNKNOWN),
            ([-1.05, 1.05], UNKNOWN),
            ([0.05, -0.85], UNKNOWN),
        ] {
            let found = grey_at(&pgm, &yaml, [x_m - 7.0, y_m + 3.0]);
            assert_eq!(found, expected, "at {x_m} {y_m}");
        }
        assert_eq!((picture.width, picture.height), (52, 31));
    }

    #[test]
    fn the_yaml_is_what_map_server_asks_for() {
        let empty = Grid::new(&randt_config::Grid::default()).picture().unwrap();
        assert_eq!(empty.to_pgm(), b"P5\n1 1\n255\n\xcd");
        assert_eq!(
            empty.to_yaml("map.pgm"),
            "image: map.pgm\nmode: trinary\nresolution: 0.100000000\n\
             origin: [0.000000000, 0.000000000, 0.0]\nnegate: 0\n\
             occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        );
    }

    #[test]
    fn grey_values_mean_to_map_server_what_they_mean_here() {
        let darkness = |grey: u8| f64::from(255 - grey) / 255.0;
        assert!(darkness(OCCUPIED) > OCCUPIED_THRESHOLD);
        assert!(darkness(FREE) < FREE_THRESHOLD);
        assert!((FREE_THRESHOLD..OCCUPIED_THRESHOLD).contains(&darkness(UNKNOWN)));
    }

    #[test]
    fn a_map_of_half_a_planet_is_refused() {
        let drawn = Drawn::from_clusters([[(1.05, 0.05, 9.0)].as_slice()]);
        let mut grid = Grid::new(&randt_config::Grid::default());
        for (id, at_m) in (0..).zip([0.0, 0.0, 9e5, 9e5]) {
            grid.update(&[drawn.at(id, Pose2::new(at_m, at_m, 0.0))]);
        }
        assert_eq!(grid.picture(), None);
    }
}

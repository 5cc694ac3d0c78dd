//! `SceneUpdate` of one tile of the occupancy grid, in quarters: what changes on the map goes to a
//! viewer a quarter at a time, where a `Grid` would have to go whole.

use crate::{MAP, pose_above, scene};
use foxglove::messages::{Color, Point3, SceneEntity, SceneUpdate, TriangleListPrimitive};
use randt_messages::{MapperGrid, MessageRef, TILE_CELLS};
use std::collections::HashMap;

/// From this value on a cell is drawn as occupied.
const OCCUPIED_MIN: u8 = 50;
const UNKNOWN: u8 = 255;
/// Occupied cells lie above the free ones by this, m, which run through below them: fewer and
/// larger rectangles.
const ABOVE_M: f64 = 0.01;

const FREE_COLOUR: Color = scene::color([0.94, 0.94, 0.94, 1.0]);
const OCCUPIED_COLOUR: Color = scene::color([0.16, 0.16, 0.16, 1.0]);

/// Cells along an edge of a quarter.
const SIDE: usize = TILE_CELLS / 2;

/// How exactly a tile is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Every cell.
    Fine,
    /// Four cells as one, which is occupied where any of them is: a quarter of the bytes, to be
    /// replaced by the fine one.
    Coarse,
}

/// A quarter of a tile: small enough to go over a slow link in a moment.
#[derive(Clone, Debug)]
pub struct TileQuarter {
    /// The entity's name, "tile ROW COLUMN.QUARTER": an entity that comes by that name replaces
    /// it.
    pub name: String,
    /// Its middle in `map`, m.
    pub middle_m: [f64; 2],
    /// Whether nothing in it is known.
    pub is_empty: bool,
    /// One entity in `map`, which stays; without a stamp, so that the same cells give the same
    /// bytes.
    pub update: SceneUpdate,
}

/// The four quarters of a tile, row by row from below. None where its cells are not a tile's.
pub fn of_tile(message: MessageRef<'_, MapperGrid>, detail: Detail) -> Vec<TileQuarter> {
    let head = message.head;
    if message.items.len() != TILE_CELLS * TILE_CELLS {
        return Vec::new();
    }
    let edge_m = head.resolution_m * SIDE as f64;
    let quarters = [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().enumerate();
    let drawn = quarters.map(|(quarter, (up, right))| {
        let fine = Patch::cut(message.items, up, right, head.resolution_m);
        let patch = match detail {
            Detail::Fine => fine,
            Detail::Coarse => fine.halved(),
        };
        let at = |tile: i32, half: usize| (2.0 * f64::from(tile) + half as f64) * edge_m;
        let corner = [at(head.column, right), at(head.row, up)];
        let triangles = patch.draw(corner);
        let name = format!("tile {} {}.{quarter}", head.row, head.column);
        TileQuarter {
            middle_m: corner.map(|m| m + 0.5 * edge_m),
            is_empty: triangles.is_empty(),
            update: scene::update(SceneEntity {
                frame_id: MAP.to_owned(),
                id: name.clone(),
                triangles,
                ..SceneEntity::default()
            }),
            name,
        }
    });
    drawn.collect()
}

/// A square of cells.
struct Patch {
    side: usize,
    cell_m: f64,
    cells: Vec<u8>,
}

impl Patch {
    fn cut(tile: &[u8], up: usize, right: usize, cell_m: f64) -> Self {
        let rows = tile.chunks_exact(TILE_CELLS).skip(up * SIDE).take(SIDE);
        let cells = rows.flat_map(|row| row.iter().skip(right * SIDE).take(SIDE));
        Self {
            side: SIDE,
            cell_m,
            cells: cells.copied().collect(),
        }
    }

    /// The same with four cells as one.
    fn halved(&self) -> Self {
        let side = self.side / 2;
        let at = |row, column| self.at(row, column).unwrap_or(UNKNOWN);
        let one = |row: usize, column: usize| {
            let four = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let four = four.map(|(up, right)| at(2 * row + up, 2 * column + right));
            let occupied = four.into_iter().find(|cell| is_occupied(*cell));
            occupied.unwrap_or(four.into_iter().min().unwrap_or(UNKNOWN))
        };
        let coarse_cells = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
        Self {
            side,
            cell_m: 2.0 * self.cell_m,
            cells: coarse_cells.map(|(row, column)| one(row, column)).collect(),
        }
    }

    fn at(&self, row: usize, column: usize) -> Option<u8> {
        self.cells.get(row * self.side + column).copied()
    }

    fn draw(&self, corner: [f64; 2]) -> Vec<TriangleListPrimitive> {
        let layer = |wanted: &dyn Fn(u8) -> bool, may: &dyn Fn(u8) -> bool, z_m, colour| {
            let mut mesh = Mesh::default();
            for rectangle in self.rectangles(wanted, may) {
                mesh.add(&rectangle);
            }
            mesh.draw(corner, self.cell_m, z_m, colour)
        };
        let known = |cell| cell != UNKNOWN;
        let layers = [
            layer(&|cell| cell < OCCUPIED_MIN, &known, 0.0, FREE_COLOUR),
            layer(&is_occupied, &is_occupied, ABOVE_M, OCCUPIED_COLOUR),
        ];
        let drawn = layers.into_iter().filter(|layer| !layer.points.is_empty());
        drawn.collect()
    }

    /// Rectangles that cover every wanted cell, and besides them only cells that may be covered:
    /// from below, each as wide as it can be and then as high.
    fn rectangles(&self, wanted: &dyn Fn(u8) -> bool, may: &dyn Fn(u8) -> bool) -> Vec<Rectangle> {
        let side = self.side;
        let mut covered = vec![false; side * side];
        let allowed = |row: usize, column: usize| self.at(row, column).is_some_and(may);
        let mut found = Vec::new();
        for (low, left) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
            let is_covered = covered.get(low * side + left).copied();
            if is_covered == Some(true) || !self.at(low, left).is_some_and(wanted) {
                continue;
            }
            let right = (left..side).find(|column| !allowed(low, *column));
            let right = right.unwrap_or(side);
            let fits = |row: &usize| (left..right).all(|column| allowed(*row, column));
            let high = (low + 1..side).find(|row| !fits(row)).unwrap_or(side);
            for row in low..high {
                let line = covered.iter_mut().skip(row * side);
                line.take(right).skip(left).for_each(|cell| *cell = true);
            }
            found.push(Rectangle {
                left,
                low,
                right,
                high,
            });
        }
        found
    }
}

fn is_occupied(cell: u8) -> bool {
    (OCCUPIED_MIN..UNKNOWN).contains(&cell)
}

/// Cells from one lattice point up to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rectangle {
    left: usize,
    low: usize,
    right: usize,
    high: usize,
}

/// Two triangles a rectangle; corners that several have stand once: a corner takes twenty bytes.
#[derive(Default)]
struct Mesh {
    corners: Vec<(usize, usize)>,
    known: HashMap<(usize, usize), u32>,
    indices: Vec<u32>,
}

impl Mesh {
    fn add(&mut self, r: &Rectangle) {
        let corners = [
            (r.left, r.low),
            (r.right, r.low),
            (r.right, r.high),
            (r.left, r.high),
        ];
        let [a, b, c, d] = corners.map(|corner| self.corner(corner));
        self.indices.extend([a, b, c, a, c, d]);
    }

    fn corner(&mut self, corner: (usize, usize)) -> u32 {
        let next = self.corners.len() as u32;
        *self.known.entry(corner).or_insert_with(|| {
            self.corners.push(corner);
            next
        })
    }

    fn draw(self, corner: [f64; 2], cell_m: f64, z_m: f64, colour: Color) -> TriangleListPrimitive {
        let point = |(x, y): &(usize, usize)| Point3 {
            x: *x as f64 * cell_m,
            y: *y as f64 * cell_m,
            z: 0.0,
        };
        TriangleListPrimitive {
            pose: Some(pose_above([corner[0], corner[1], 0.0], z_m)),
            points: self.corners.iter().map(point).collect(),
            color: Some(colour),
            colors: Vec::new(),
            indices: self.indices,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_messages::Message;

    const CELLS: usize = TILE_CELLS * TILE_CELLS;

    fn tile(items: Vec<u8>) -> Message<MapperGrid> {
        let mut tile = Message::<MapperGrid>::default();
        (tile.head.row, tile.head.column) = (-1, 2);
        tile.head.resolution_m = 0.1;
        tile.items = items;
        tile
    }

    /// The cells as a viewer shows them: free below, occupied above.
    fn shown(quarters: &[TileQuarter]) -> Vec<u8> {
        let mut cells = vec![UNKNOWN; CELLS];
        for layer in quarters
            .iter()
            .flat_map(|quarter| &quarter.update.entities[0].triangles)
        {
            let is_dark = layer.color.unwrap().r < 0.5;
            let origin = layer.pose.unwrap().position.unwrap();
            for six in layer.indices.chunks_exact(6) {
                let corner = |i: usize| {
                    let point = layer.points[six[i] as usize];
                    let [x, y] = [origin.x + point.x - 12.8, origin.y + point.y + 6.4];
                    [x, y].map(|m| (m * 10.0).round() as usize)
                };
                let ([left, low], [right, high]) = (corner(0), corner(2));
                for row in low..high {
                    cells[row * TILE_CELLS + left..row * TILE_CELLS + right].fill(if is_dark {
                        100
                    } else {
                        0
                    });
                }
            }
        }
        cells
    }

    #[test]
    fn a_room_is_a_few_rectangles_where_it_belongs() {
        let mut cells = vec![0; CELLS];
        for i in 0..TILE_CELLS {
            cells[i] = 100;
            cells[i * TILE_CELLS] = 100;
        }
        let quarters = of_tile(tile(cells.clone()).as_ref(), Detail::Fine);
        let entity = &quarters[1].update.entities[0];
        assert_eq!(
            (entity.id.as_str(), entity.frame_id.as_str()),
            ("tile -1 2.1", MAP)
        );
        assert!(entity.lifetime.is_none(), "it stays");
        assert!((quarters[1].middle_m[0] - 17.6).abs() < 1e-12);
        assert!((quarters[1].middle_m[1] + 4.8).abs() < 1e-12);
        let count = |quarter: &TileQuarter| {
            let layers = quarter.update.entities[0].triangles.iter();
            layers.map(|layer| layer.indices.len() / 6).sum::<usize>()
        };
        let counts: Vec<_> = quarters.iter().map(count).collect();
        assert_eq!(counts, [3, 2, 2, 1], "the floor, and the walls");
        assert_eq!(shown(&quarters), cells);
        // One that became empty replaces what was there.
        let gone = of_tile(tile(vec![UNKNOWN; CELLS]).as_ref(), Detail::Fine);
        assert!(gone.iter().all(|quarter| quarter.is_empty));
        assert!(of_tile(tile(vec![0; 7]).as_ref(), Detail::Fine).is_empty());
    }

    proptest! {
        #[test]
        fn any_tile_is_shown_as_it_is_and_no_wall_is_lost_in_the_coarse(
            items in proptest::collection::vec(prop_oneof![Just(0u8), Just(100), Just(UNKNOWN)], CELLS)
        ) {
            let message = tile(items.clone());
            prop_assert_eq!(&shown(&of_tile(message.as_ref(), Detail::Fine)), &items);
            let coarse = shown(&of_tile(message.as_ref(), Detail::Coarse));
            for (fine, coarse) in items.iter().zip(coarse) {
                prop_assert!(*fine != 100 || coarse == 100);
                prop_assert!(*fine == UNKNOWN || coarse != UNKNOWN);
            }
        }
    }
}

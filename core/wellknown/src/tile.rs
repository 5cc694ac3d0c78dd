//! `SceneUpdate` of one tile of the occupancy grid: what changes on the map goes to a viewer tile by tile, where a `Grid`
//! would have to go whole.

use crate::{MAP, pose_of, scene};
use foxglove::messages::{Color, Point3, SceneEntity, SceneUpdate, TriangleListPrimitive};
use randt_messages::{MapperGrid, MessageRef, TILE_CELLS};
use std::collections::HashMap;

/// From this value on a cell is drawn as occupied.
const OCCUPIED_MIN: u8 = 50;
const UNKNOWN: u8 = 255;
/// Occupied cells lie above the free ones by this, m, which run through below them: fewer and larger rectangles.
const ABOVE_M: f64 = 0.01;

const FREE_COLOUR: Color = Color {
    r: 0.94,
    g: 0.94,
    b: 0.94,
    a: 1.0,
};
const OCCUPIED_COLOUR: Color = Color {
    r: 0.16,
    g: 0.16,
    b: 0.16,
    a: 1.0,
};

/// The tile as one entity, "tile ROW COLUMN" in `map`, which stays until the next one of that name; without a
/// stamp, so that the same cells give the same bytes. `None` where its cells are not a tile's.
pub fn of_tile(message: MessageRef<'_, MapperGrid>) -> Option<SceneUpdate> {
    let (head, cells) = (message.head, message.items);
    if cells.len() != TILE_CELLS * TILE_CELLS {
        return None;
    }
    let edge_m = head.resolution_m * TILE_CELLS as f64;
    let corner = [head.column, head.row].map(|tiles| f64::from(tiles) * edge_m);
    let occupied = |cell: u8| (OCCUPIED_MIN..UNKNOWN).contains(&cell);
    let free = |cell: u8| cell < OCCUPIED_MIN;
    let layer = |wanted: &dyn Fn(u8) -> bool, may: &dyn Fn(u8) -> bool, z_m: f64, colour| {
        let mut mesh = Mesh::default();
        for rectangle in rectangles(cells, wanted, may) {
            mesh.add(&rectangle);
        }
        mesh.draw(corner, head.resolution_m, z_m, colour)
    };
    let triangles = [
        layer(&free, &|cell| cell != UNKNOWN, 0.0, FREE_COLOUR),
        layer(&occupied, &occupied, ABOVE_M, OCCUPIED_COLOUR),
    ];
    let mut entity = SceneEntity {
        frame_id: MAP.to_owned(),
        id: format!("tile {} {}", head.row, head.column),
        ..SceneEntity::default()
    };
    let drawn = triangles.into_iter().filter(|t| !t.points.is_empty());
    entity.triangles.extend(drawn);
    Some(scene(entity))
}

/// Cells from one lattice point up to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rectangle {
    left: usize,
    low: usize,
    right: usize,
    high: usize,
}

/// Rectangles that cover every wanted cell, and beside them only such as may be covered: from below, each as wide as it
/// can be and then as high.
fn rectangles(
    cells: &[u8],
    wanted: &dyn Fn(u8) -> bool,
    may: &dyn Fn(u8) -> bool,
) -> Vec<Rectangle> {
    let mut covered = [false; TILE_CELLS * TILE_CELLS];
    let at = |row: usize, column: usize| cells.get(row * TILE_CELLS + column).copied();
    let allowed = |row: usize, column: usize| at(row, column).is_some_and(may);
    let mut found = Vec::new();
    for low in 0..TILE_CELLS {
        for left in 0..TILE_CELLS {
            let is_covered = covered.get(low * TILE_CELLS + left).copied();
            if is_covered == Some(true) || !at(low, left).is_some_and(wanted) {
                continue;
            }
            let right = (left..TILE_CELLS)
                .find(|column| !allowed(low, *column))
                .unwrap_or(TILE_CELLS);
            let high = (low + 1..TILE_CELLS)
                .find(|row| (left..right).any(|column| !allowed(*row, column)))
                .unwrap_or(TILE_CELLS);
            for row in low..high {
                let (from, to) = (row * TILE_CELLS + left, row * TILE_CELLS + right);
                covered
                    .iter_mut()
                    .take(to)
                    .skip(from)
                    .for_each(|c| *c = true);
            }
            found.push(Rectangle {
                left,
                low,
                right,
                high,
            });
        }
    }
    found
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
        let mut pose = pose_of([corner[0], corner[1], 0.0]);
        if let Some(position) = &mut pose.position {
            position.z = z_m;
        }
        TriangleListPrimitive {
            pose: Some(pose),
            points: self
                .corners
                .iter()
                .map(|(x, y)| Point3 {
                    x: *x as f64 * cell_m,
                    y: *y as f64 * cell_m,
                    z: 0.0,
                })
                .collect(),
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
    fn shown(update: &SceneUpdate) -> Vec<u8> {
        let mut cells = vec![UNKNOWN; CELLS];
        let entity = &update.entities[0];
        for layer in &entity.triangles {
            let is_dark = layer.color.unwrap().r < 0.5;
            for six in layer.indices.chunks_exact(6) {
                let corner = |i: usize| {
                    let point = layer.points[six[i] as usize];
                    [point.x, point.y].map(|m| (m * 10.0).round() as usize)
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
        let update = of_tile(tile(cells.clone()).as_ref()).unwrap();
        let entity = &update.entities[0];
        assert_eq!(
            (entity.id.as_str(), entity.frame_id.as_str()),
            ("tile -1 2", MAP)
        );
        assert!(entity.lifetime.is_none(), "it stays");
        let corner = entity.triangles[0].pose.unwrap().position.unwrap();
        assert!((corner.x - 12.8).abs() < 1e-12 && (corner.y + 6.4).abs() < 1e-12);
        let indices: usize = entity.triangles.iter().map(|t| t.indices.len()).sum();
        assert_eq!(indices, 3 * 6, "the floor, and two walls");
        assert_eq!(shown(&update), cells);
        // One that became empty takes the place of what was there.
        let gone = of_tile(tile(vec![UNKNOWN; CELLS]).as_ref()).unwrap();
        assert!(gone.entities[0].triangles.is_empty());
        assert!(of_tile(tile(vec![0; 7]).as_ref()).is_none());
    }

    proptest! {
        #[test]
        fn any_tile_is_shown_as_it_is(
            items in proptest::collection::vec(prop_oneof![Just(0u8), Just(100), Just(UNKNOWN)], CELLS)
        ) {
            let update = of_tile(tile(items.clone()).as_ref()).unwrap();
            prop_assert_eq!(shown(&update), items);
        }
    }
}

//! A world: walls as line segments, and a route through them. Plain data.

use crate::Material;
use nalgebra::Vector2;

/// A straight piece of wall, seen from above; has no thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, m.
    pub from_m: Vector2<f64>,
    /// The other end, m.
    pub to_m: Vector2<f64>,
    /// What it is made of.
    pub material: Material,
}

/// Walls, and a closed route that a robot can drive for ever.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Short name.
    pub name: String,
    /// The walls.
    pub walls: Vec<Wall>,
    /// Corners of the route, m; the last is followed by the first.
    pub route_m: Vec<Vector2<f64>>,
}

impl World {
    /// Adds a wall.
    pub fn wall(&mut self, from_m: [f64; 2], to_m: [f64; 2], material: Material) {
        self.walls.push(Wall {
            from_m: from_m.into(),
            to_m: to_m.into(),
            material,
        });
    }

    /// Adds a wall with openings, each with its distances from `from_m`, m, in order; each opening gets a
    /// metal frame as deep as a partition.
    pub fn wall_with_doors(
        &mut self,
        from_m: [f64; 2],
        to_m: [f64; 2],
        material: Material,
        openings_m: &[(f64, f64)],
    ) {
        const FRAME_DEPTH_M: f64 = 0.12;
        let (from, to) = (Vector2::from(from_m), Vector2::from(to_m));
        let length = (to - from).norm();
        let along = (to - from) / length;
        let across = Vector2::new(-along.y, along.x) * (0.5 * FRAME_DEPTH_M);
        let mut begin = 0.0;
        for &(open, close) in openings_m {
            self.walls.push(Wall {
                from_m: from + along * begin,
                to_m: from + along * open,
                material,
            });
            for edge in [from + along * open, from + along * close] {
                let (from_m, to_m) = (edge - across, edge + across);
                self.walls.push(Wall {
                    from_m,
                    to_m,
                    material: Material::Metal,
                });
            }
            begin = close;
        }
        self.walls.push(Wall {
            from_m: from + along * begin,
            to_m: to,
            material,
        });
    }

    /// Adds a box (furniture, pillar) by its corner of smallest coordinates and its size.
    pub fn block(&mut self, corner_m: [f64; 2], size_m: [f64; 2], material: Material) {
        let [x, y] = corner_m;
        let [w, h] = size_m;
        let corners = [[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]];
        for (from, to) in corners.iter().zip(corners.iter().skip(1)) {
            self.wall(*from, *to, material);
        }
    }

    /// The world of a name; `None` for any other.
    pub fn named(name: &str) -> Option<Self> {
        (name == "building").then(Self::building)
    }

    /// The names that [`World::named`] knows.
    pub const NAMES: [&'static str; 1] = ["building"];
}

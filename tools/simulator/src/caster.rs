//! Where a ray meets walls: every wall along it, nearest first, by a uniform grid.

use crate::{Material, Wall};
use nalgebra::Vector2;

/// Edge of a grid cell. About the distance between walls: smaller ones cost steps, larger ones
/// tests.
const CELL_M: f64 = 1.0;
/// Nearer than this a wall is the one that the ray starts from.
const SELF_HIT_M: f64 = 1e-6;

/// A wall in a ray's way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin.
    pub range_m: f64,
    /// Cosine of the angle between ray and wall's normal, 0..1.
    pub cos_incidence: f64,
    /// The wall's unit normal, towards the ray's origin.
    pub normal: Vector2<f64>,
    /// The wall's material.
    pub material: Material,
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    from: Vector2<f64>,
    along: Vector2<f64>,
    normal: Vector2<f64>,
    material: Material,
}

/// Walls, sorted into a grid.
#[derive(Clone, Debug)]
pub struct Caster {
    segments: Vec<Segment>,
    origin: Vector2<f64>,
    columns: i64,
    rows: i64,
    /// Cell c holds `entries[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Caster {
    /// Sorts walls into the grid. Walls without length or with coordinates that are not finite are
    /// left out.
    pub fn new(walls: &[Wall]) -> Self {
        let segments: Vec<Segment> = walls.iter().filter_map(segment).collect();
        let ends = segments.iter().flat_map(|it| [it.from, it.from + it.along]);
        let low = ends.clone().reduce(|a, b| a.inf(&b)).unwrap_or_default();
        let high = ends.reduce(|a, b| a.sup(&b)).unwrap_or_default();
        let origin = low.add_scalar(-0.5 * CELL_M);
        // A map of 4 km is a mistake; the grid then only loses speed at its rim.
        let cells = |extent: f64| (extent / CELL_M).ceil().clamp(1.0, 4096.0) as i64;
        let columns = cells(high.x - origin.x + 0.5 * CELL_M);
        let rows = cells(high.y - origin.y + 0.5 * CELL_M);
        let mut lists = vec![Vec::new(); (columns * rows) as usize];
        for (index, segment) in segments.iter().enumerate() {
            let end = segment.from + segment.along;
            let cell = |x: f64, count: i64| ((x / CELL_M).floor() as i64).clamp(0, count - 1);
            let low = segment.from.inf(&end) - origin;
            let high = segment.from.sup(&end) - origin;
            for row in cell(low.y, rows)..=cell(high.y, rows) {
                for column in cell(low.x, columns)..=cell(high.x, columns) {
                    if let Some(list) = lists.get_mut((row * columns + column) as usize) {
                        list.push(index as u32);
                    }
                }
            }
        }
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for list in lists {
            entries.extend(list);
            starts.push(entries.len() as u32);
        }
        Self {
            segments,
            origin,
            columns,
            rows,
            starts,
            entries,
        }
    }

    /// Collects the walls along a ray of unit `direction` up to `range_max_m`, nearest first, up
    /// to and with the first one that lets nothing through. `hits` is emptied first.
    pub fn cast(
        &self,
        origin: Vector2<f64>,
        direction: Vector2<f64>,
        range_max_m: f64,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        let start = (origin - self.origin) / CELL_M;
        let (mut column, mut row) = (start.x.floor() as i64, start.y.floor() as i64);
        let (step_x, mut next_x, delta_x) = march(start.x, direction.x);
        let (step_y, mut next_y, delta_y) = march(start.y, direction.y);
        let mut entered_m = 0.0;
        let mut sorted = 0;
        while entered_m <= range_max_m {
            if (0..self.columns).contains(&column) && (0..self.rows).contains(&row) {
                let cell = (row * self.columns + column) as usize;
                self.test_cell(cell, origin, direction, range_max_m, hits);
            } else if leaving(column, step_x, self.columns) || leaving(row, step_y, self.rows) {
                break;
            }
            entered_m = next_x.min(next_y);
            // Hits before the cell's end are final; a wall that reaches on into the next cells is
            // met there again and is known by its range.
            if let Some(fresh) = hits.get_mut(sorted..) {
                fresh.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
            }
            while let Some(hit) = hits.get(sorted).filter(|hit| hit.range_m <= entered_m) {
                sorted += 1;
                if opaque(hit.material) {
                    hits.truncate(sorted);
                    return;
                }
            }
            if next_x < next_y {
                column += step_x;
                next_x += delta_x;
            } else {
                row += step_y;
                next_y += delta_y;
            }
        }
        hits.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        if let Some(end) = hits.iter().position(|hit| opaque(hit.material)) {
            hits.truncate(end + 1);
        }
    }

    fn test_cell(
        &self,
        cell: usize,
        origin: Vector2<f64>,
        direction: Vector2<f64>,
        range_max_m: f64,
        hits: &mut Vec<Hit>,
    ) {
        let (Some(&begin), Some(&end)) = (self.starts.get(cell), self.starts.get(cell + 1)) else {
            return;
        };
        let entries = self.entries.get(begin as usize..end as usize);
        let entries = entries.unwrap_or_default().iter();
        for segment in entries.filter_map(|index| self.segments.get(*index as usize)) {
            // origin + t direction = from + u along
            let cross = direction.perp(&segment.along);
            if cross == 0.0 {
                continue;
            }
            let offset = segment.from - origin;
            let range_m = offset.perp(&segment.along) / cross;
            let fraction = offset.perp(&direction) / cross;
            let material = segment.material;
            let is_same = |hit: &Hit| hit.range_m == range_m && hit.material == material;
            if range_m > SELF_HIT_M
                && range_m <= range_max_m
                && (0.0..=1.0).contains(&fraction)
                && !hits.iter().any(is_same)
            {
                let facing = direction.dot(&segment.normal);
                hits.push(Hit {
                    range_m,
                    cos_incidence: facing.abs(),
                    normal: segment.normal * if facing > 0.0 { -1.0 } else { 1.0 },
                    material,
                });
            }
        }
    }
}

fn segment(wall: &Wall) -> Option<Segment> {
    let along = wall.to_m - wall.from_m;
    let length = along.norm();
    (length > 0.0 && length.is_finite() && wall.from_m.norm().is_finite()).then(|| Segment {
        from: wall.from_m,
        along,
        normal: Vector2::new(-along.y, along.x) / length,
        material: wall.material,
    })
}

/// Step of the cell index, distance to the first border and between borders, along one axis.
fn march(start: f64, direction: f64) -> (i64, f64, f64) {
    let inside = start - start.floor();
    if direction > 0.0 {
        (1, (1.0 - inside) * CELL_M / direction, CELL_M / direction)
    } else if direction < 0.0 {
        (-1, inside * CELL_M / -direction, CELL_M / -direction)
    } else {
        (0, f64::INFINITY, f64::INFINITY)
    }
}

/// Whether a ray outside the grid can never come back along this axis.
fn leaving(index: i64, step: i64, count: i64) -> bool {
    (index < 0 && step <= 0) || (index >= count && step >= 0)
}

fn opaque(material: Material) -> bool {
    matches!(material, Material::Concrete | Material::Metal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_geometry::elementary::{PI, sin_cos};

    fn wall(from: [f64; 2], to: [f64; 2], material: Material) -> Wall {
        Wall {
            from_m: from.into(),
            to_m: to.into(),
            material,
        }
    }
    fn cast(walls: &[Wall], origin: [f64; 2], angle_rad: f64, range_max_m: f64) -> Vec<Hit> {
        let (sin, cos) = sin_cos(angle_rad);
        let mut hits = Vec::new();
        Caster::new(walls).cast(
            origin.into(),
            Vector2::new(cos, sin),
            range_max_m,
            &mut hits,
        );
        hits
    }

    #[test]
    fn a_wall_across_is_met_at_its_distance_and_angle() {
        let walls = [wall([3.0, -50.0], [3.0, 50.0], Material::Concrete)];
        for angle in [-1.2, -0.3, 0.0, 0.7, 1.3_f64] {
            let hits = cast(&walls, [0.0, 0.0], angle, 20.0);
            let cos = randt_geometry::elementary::cos(angle);
            assert_eq!(hits.len(), 1);
            assert!((hits[0].range_m - 3.0 / cos).abs() < 1e-12);
            assert!((hits[0].cos_incidence - cos).abs() < 1e-12);
            assert_eq!(hits[0].normal, Vector2::new(-1.0, 0.0));
        }
        assert!(cast(&walls, [0.0, 0.0], PI, 20.0).is_empty());
        assert!(cast(&walls, [0.0, 0.0], 0.0, 2.9).is_empty());
    }

    #[test]
    fn thin_walls_let_through_and_thick_ones_end_the_ray() {
        let walls = [
            wall([5.0, -1.0], [5.0, 1.0], Material::Concrete),
            wall([2.0, -1.0], [2.0, 1.0], Material::Plaster),
            wall([9.0, -1.0], [9.0, 1.0], Material::Metal),
            wall([3.5, -1.0], [3.5, 1.0], Material::Glass),
        ];
        let ranges: Vec<f64> = cast(&walls, [0.0, 0.0], 0.0, 20.0)
            .iter()
            .map(|h| h.range_m)
            .collect();
        assert_eq!(ranges, [2.0, 3.5, 5.0]);
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_testing_every_wall_finds(
            ends in prop::collection::vec((-20.0..20.0, -20.0..20.0, -8.0..8.0, -8.0..8.0), 1..40),
            x in -30.0..30.0, y in -30.0..30.0, angle in -3.2..3.2,
        ) {
            let walls: Vec<Wall> = ends
                .iter()
                .map(|&(x, y, dx, dy)| wall([x, y], [x + dx, y + dy], Material::Plaster))
                .collect();
            let found = cast(&walls, [x, y], angle, 25.0);
            let mut expected: Vec<f64> = walls
                .iter()
                .flat_map(|one| cast(&[*one], [x, y], angle, 25.0))
                .map(|hit| hit.range_m)
                .collect();
            expected.sort_by(f64::total_cmp);
            let found: Vec<f64> = found.iter().map(|hit| hit.range_m).collect();
            prop_assert_eq!(found, expected);
        }
    }
}

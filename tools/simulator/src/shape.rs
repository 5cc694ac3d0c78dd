//! Shapes that worlds are built of, as straight pieces of wall.

use crate::{Material, Random, Wall};
use nalgebra::Vector2;
use randt_geometry::elementary::{PI, sin_cos};

/// Depth of a door frame, as deep as a partition.
const FRAME_DEPTH_M: f64 = 0.12;
/// Sides of a post: flat faces of a hand's width at the thickness of a tree.
const POST_SIDES: u32 = 10;
/// Length of a rough wall's pieces: a radar's range resolution is finer, its beams are wider.
const ROUGH_STEP_M: f64 = 0.25;
/// Roughness is a sum of this many scales, each half as long and half as high as the one before: 2
/// m to 0.25 m.
const ROUGH_SCALES: u32 = 4;

/// What stands in an opening of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opening {
    /// Nothing, between metal frames.
    Door,
    /// Glass.
    Window,
    /// Nothing.
    Gap,
}

/// An opening, between two distances from the wall's first point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub opening: Opening,
    pub from_m: f64,
    pub to_m: f64,
}

/// Length of a line.
pub(crate) fn length_m(line: &[Vector2<f64>]) -> f64 {
    pieces(line).map(|(from, to)| (to - from).norm()).sum()
}

fn pieces(line: &[Vector2<f64>]) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
    line.iter().copied().zip(line.iter().copied().skip(1))
}

/// A wall along a line, with openings in order of their distance from its first point.
pub(crate) fn wall(line: &[Vector2<f64>], material: Material, spans: &[Span], out: &mut Vec<Wall>) {
    let mut start_m = 0.0;
    for (from, to) in pieces(line) {
        let length = (to - from).norm();
        let along = (to - from) / length;
        let end_m = start_m + length;
        let mut push = |begin_m: f64, end_m: f64, material| {
            if end_m > begin_m {
                out.push(Wall {
                    from_m: from + along * (begin_m - start_m),
                    to_m: from + along * (end_m - start_m),
                    material,
                });
            }
        };
        let mut begin_m = start_m;
        for span in spans {
            let (open_m, close_m) = (span.from_m.max(start_m), span.to_m.min(end_m));
            if close_m > open_m {
                push(begin_m, open_m, material);
                if span.opening == Opening::Window {
                    push(open_m, close_m, Material::Glass);
                }
                begin_m = close_m;
            }
        }
        push(begin_m, end_m, material);
        let across = Vector2::new(-along.y, along.x) * (0.5 * FRAME_DEPTH_M);
        let doors = spans.iter().filter(|span| span.opening == Opening::Door);
        for edge_m in doors.flat_map(|door| [door.from_m, door.to_m]) {
            if (start_m..=end_m).contains(&edge_m) {
                let edge = from + along * (edge_m - start_m);
                out.push(Wall {
                    from_m: edge - across,
                    to_m: edge + across,
                    material: Material::Metal,
                });
            }
        }
        start_m = end_m;
    }
}

/// A box (furniture, pillar, vehicle) by its corner of smallest coordinates and its size, turned
/// about its middle.
pub(crate) fn block(
    corner_m: Vector2<f64>,
    size_m: Vector2<f64>,
    turn_rad: f64,
    material: Material,
    out: &mut Vec<Wall>,
) {
    let centre = corner_m + size_m * 0.5;
    let (sin, cos) = sin_cos(turn_rad);
    let corner = |x: f64, y: f64| {
        let (x, y) = (x * size_m.x * 0.5, y * size_m.y * 0.5);
        centre + Vector2::new(cos * x - sin * y, sin * x + cos * y)
    };
    let (first, third) = (corner(-1.0, -1.0), corner(1.0, 1.0));
    let line = [first, corner(1.0, -1.0), third, corner(-1.0, 1.0), first];
    wall(&line, material, &[], out);
}

/// A round post or trunk, as a polygon.
pub(crate) fn post(centre_m: Vector2<f64>, radius_m: f64, material: Material, out: &mut Vec<Wall>) {
    let corner = |index: u32| {
        let (sin, cos) = sin_cos(2.0 * PI * f64::from(index % POST_SIDES) / f64::from(POST_SIDES));
        centre_m + Vector2::new(cos, sin) * radius_m
    };
    let line: Vec<_> = (0..=POST_SIDES).map(corner).collect();
    wall(&line, material, &[], out);
}

/// A line roughened at scales from 2 m down to its pieces' length. The largest scale's deviations
/// go up to `amplitude_m` towards x and y; both ends stay where they are, so that lines join.
pub(crate) fn roughened(line: &[Vector2<f64>], amplitude_m: f64, seed: u64) -> Vec<Vector2<f64>> {
    let mut points: Vec<Vector2<f64>> = Vec::new();
    for (from, to) in pieces(line) {
        let count = ((to - from).norm() / ROUGH_STEP_M).ceil().max(1.0) as u32;
        points.extend((0..count).map(|i| from + (to - from) * (f64::from(i) / f64::from(count))));
    }
    points.extend(line.last());
    let last = points.len().saturating_sub(1);
    for scale in 0..ROUGH_SCALES {
        let mut random = Random::new(seed, u64::from(scale));
        let size_m = amplitude_m / f64::from(1_u32 << scale);
        // Straight between random offsets at regular points.
        let every = 1_usize << (ROUGH_SCALES - 1 - scale);
        let mut offset = || Vector2::from_fn(|_, _| random.between(-size_m, size_m));
        let (mut before, mut after) = (Vector2::zeros(), offset());
        for (index, point) in points.iter_mut().enumerate().take(last).skip(1) {
            if index % every == 0 {
                (before, after) = (after, offset());
            }
            let share = (index % every) as f64 / every as f64;
            *point += before + (after - before) * share;
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openings_go_round_corners_and_doors_have_frames() {
        let line = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]].map(Vector2::from);
        let span = |opening, from_m, to_m| Span {
            opening,
            from_m,
            to_m,
        };
        let spans = [
            span(Opening::Door, 1.0, 2.0),
            span(Opening::Window, 3.0, 5.0),
        ];
        let mut walls = Vec::new();
        wall(&line, Material::Concrete, &spans, &mut walls);
        let length = |material| -> f64 {
            let of = walls.iter().filter(|wall| wall.material == material);
            of.map(|wall| (wall.to_m - wall.from_m).norm()).sum()
        };
        assert!((length(Material::Concrete) - 4.0).abs() < 1e-12);
        assert!((length(Material::Glass) - 2.0).abs() < 1e-12);
        assert!((length(Material::Metal) - 0.24).abs() < 1e-12);
    }

    #[test]
    fn a_turned_block_keeps_its_middle_and_size() {
        let mut walls = Vec::new();
        let (corner, size) = (Vector2::new(1.0, 2.0), Vector2::new(4.0, 2.0));
        block(corner, size, 0.5 * PI, Material::Metal, &mut walls);
        let low = walls
            .iter()
            .fold(Vector2::repeat(9.0), |low, wall| low.inf(&wall.from_m));
        assert!((low - Vector2::new(2.0, 1.0)).norm() < 1e-12, "{low}");
        assert_eq!(walls.len(), 4);
        assert_eq!(walls[0].from_m, walls[3].to_m);
    }

    #[test]
    fn a_rough_wall_is_rough_at_every_scale_and_keeps_its_ends() {
        let line = [[0.0, 0.0], [100.0, 0.0]].map(Vector2::from);
        let points = roughened(&line, 0.15, 7);
        assert_eq!(points.len(), 401);
        assert_eq!((points[0], points[400]), (line[0], line[1]));
        let spread = |step: usize| {
            let squares = points
                .windows(step + 1)
                .map(|w| (w[step].y - w[0].y) * (w[step].y - w[0].y));
            (squares.sum::<f64>() / (401 - step) as f64).sqrt()
        };
        let (fine, coarse) = (spread(1), spread(12));
        assert!(
            (0.03..0.1).contains(&fine) && (0.1..0.2).contains(&coarse),
            "{fine} {coarse}"
        );
        assert!(points.iter().all(|point| point.y.abs() <= 0.3));
        assert!(points != roughened(&line, 0.15, 8));
    }
}

//! `SceneUpdate`: cells of the normal distributions transform, as ellipses.

use crate::scene::{Colour, drawing, lines, point};
use crate::{ODOM, pose_of};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{LinePrimitive, SceneUpdate};
use randt_geometry::elementary::sin_cos;
use randt_ndt::Cell;

/// Corners of an ellipse.
const CORNERS: u32 = 12;
/// How many standard deviations it is wide to each side: within are 86 % of the points.
pub(crate) const DEVIATIONS: f64 = 2.0;
/// Faint to strong (viridis without its darkest, which cannot be seen on a dark ground). Cells of
/// one colour are one primitive: viewers draw a few large ones easily, and hundreds of small ones
/// not.
pub(crate) const COLOURS: [Colour; 6] = [
    [0.27, 0.35, 0.64, 0.9],
    [0.16, 0.47, 0.56, 0.9],
    [0.13, 0.66, 0.52, 0.9],
    [0.48, 0.82, 0.32, 0.9],
    [0.74, 0.87, 0.15, 0.9],
    [0.99, 0.91, 0.14, 0.9],
];
/// This share of the intensities at either end does not stretch the scale of colours.
const OUTSIDE: f64 = 0.05;

/// Cells in the frame of a root, that lies in `odom` (x m, y m, yaw rad), coloured by their mean
/// intensity.
pub fn of_cells<'a>(
    cells: impl Iterator<Item = &'a Cell>,
    root: [f64; 3],
    stamp_ns: i64,
) -> SceneUpdate {
    let cells: Vec<&Cell> = cells.collect();
    let circle: Vec<(f64, f64)> = (0..CORNERS)
        .map(|corner| sin_cos(core::f64::consts::TAU * f64::from(corner) / f64::from(CORNERS)))
        .collect();
    let scale = Scale::from_cells(&cells);
    let mut drawn = COLOURS.map(|colour| LinePrimitive {
        pose: Some(pose_of(root)),
        ..lines(Type::LineList, Vec::new(), colour)
    });
    for cell in cells {
        if let Some(primitive) = drawn.get_mut(scale.colour(cell)) {
            outline(cell, &circle, primitive);
        }
    }
    let lines = drawn.into_iter().filter(|line| !line.points.is_empty());
    drawing(ODOM, "cells", stamp_ns, lines.collect())
}

/// Adds an ellipse: each corner once, and each side by the numbers of its ends.
fn outline(cell: &Cell, circle: &[(f64, f64)], to: &mut LinePrimitive) {
    let [xx, xy, yy, ..] = cell.covariance;
    // The covariance's Cholesky factor turns the unit circle into the ellipse.
    let along = xx.max(0.0).sqrt();
    let slant = if along > 0.0 { xy / along } else { 0.0 };
    let across = (yy - slant * slant).max(0.0).sqrt();
    let first = to.points.len() as u32;
    for (corner, (sine, cosine)) in (0..CORNERS).zip(circle) {
        to.points.push(point([
            cell.mean[0] + DEVIATIONS * along * cosine,
            cell.mean[1] + DEVIATIONS * (slant * cosine + across * sine),
        ]));
        let next = (corner + 1) % CORNERS;
        to.indices.extend([first + corner, first + next]);
    }
}

/// Which intensity has which colour.
pub(crate) struct Scale {
    least: f64,
    most: f64,
}

impl Scale {
    pub fn from_cells(cells: &[&Cell]) -> Self {
        let mut means: Vec<f64> = cells.iter().map(|cell| cell.mean[2]).collect();
        means.sort_by(f64::total_cmp);
        let outside = (OUTSIDE * means.len() as f64) as usize;
        let end = means.len().saturating_sub(1 + outside);
        let at = |index: usize| means.get(index).copied().unwrap_or_default();
        Self {
            least: at(outside),
            most: at(end),
        }
    }

    pub fn colour(&self, cell: &Cell) -> usize {
        let span = (self.most - self.least).max(f64::MIN_POSITIVE);
        let share = (cell.mean[2] - self.least) / span;
        // Below 0 and what is not a number are the first.
        ((share * COLOURS.len() as f64) as usize).min(COLOURS.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x_m: f64, intensity: f64) -> Cell {
        Cell {
            mean: [x_m, 1.0, intensity],
            covariance: [0.04, 0.01, 0.09, 0.0, 0.0, 1.0],
            count: 9,
        }
    }

    #[test]
    fn corners_lie_two_deviations_from_the_mean() {
        let cells = [cell(3.0, 5.0)];
        let update = of_cells(cells.iter(), [10.0, 0.0, 0.0], 0);
        let line = &update.entities[0].lines[0];
        assert_eq!(line.points.len(), 12);
        assert_eq!(line.indices[22..], [11, 0]);
        assert_eq!(line.pose.unwrap().position.unwrap().x, 10.0);
        let [xx, xy, yy] = [0.04, 0.01, 0.09];
        let determinant: f64 = xx * yy - xy * xy;
        for corner in &line.points {
            let (dx, dy) = (corner.x - 3.0, corner.y - 1.0);
            let squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / determinant;
            assert!((squared.sqrt() - 2.0).abs() < 0.05, "{squared}");
        }
    }

    #[test]
    fn colours_go_from_faint_to_strong() {
        let cells: Vec<Cell> = (0..100).map(|n| cell(0.0, f64::from(n))).collect();
        let update = of_cells(cells.iter(), [0.0; 3], 0);
        let lines = &update.entities[0].lines;
        assert_eq!(lines.len(), COLOURS.len());
        let corners: usize = lines.iter().map(|line| line.points.len()).sum();
        assert_eq!(corners, 1200);
        let blue = |line: &LinePrimitive| line.color.unwrap().b;
        assert!(blue(&lines[0]) > blue(&lines[5]));
        // Nothing, one and all alike are no scale.
        assert!(
            of_cells([].iter(), [0.0; 3], 0).entities[0]
                .lines
                .is_empty()
        );
        let alike = [cell(0.0, 7.0), cell(1.0, 7.0)];
        assert_eq!(
            of_cells(alike.iter(), [0.0; 3], 0).entities[0].lines.len(),
            1
        );
        let unknown = [cell(0.0, f64::NAN)];
        assert_eq!(
            of_cells(unknown.iter(), [0.0; 3], 0).entities[0]
                .lines
                .len(),
            1
        );
    }
}

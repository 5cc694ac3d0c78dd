//! Which part of the plane a picture shows, and how large.

use crate::Plot;
use crate::read::POSITION_MAX_M;
use crate::ticks::{self, step};
use std::ops::Range;

/// Width of the picture, pixels.
pub(crate) const WIDTH: u32 = 1400;
/// Room for heading and legend, for the numbers left and below, and on the right, pixels.
pub(crate) const TOP: u32 = 84;
pub(crate) const LEFT: u32 = 80;
pub(crate) const BOTTOM: u32 = 64;
pub(crate) const RIGHT: u32 = 30;
/// Room outside of everything, pixels.
pub(crate) const EDGE: u32 = 10;
/// Least and greatest height of the drawing itself, pixels: a straight drive still has room for
/// its axis.
const HEIGHT_MIN: f64 = 380.0;
const HEIGHT_MAX: f64 = 1500.0;
/// Of the map, what is within this share of the drive's extent around it, and at least this many
/// metres.
const MAP_MARGIN: f64 = 0.5;
const MAP_MARGIN_MIN_M: f64 = 12.0;
/// Room around what is drawn, as a share of it, and at least this many metres.
const MARGIN: f64 = 0.05;
const MARGIN_MIN_M: f64 = 0.5;
/// Between the rest and a component that is apart, and between two of these, as a share of the
/// rest's longer side, and at least this many metres.
const APART: f64 = 0.04;
const APART_MIN_M: f64 = 2.0;
/// Grid lines along the longer side, about.
const GRID_LINES: f64 = 10.0;

/// A rectangle of the plane with axes alike, m.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct View {
    /// From left to right.
    pub x_m: Range<f64>,
    /// From below to above.
    pub y_m: Range<f64>,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Distance of the grid's lines: 1, 2 or 5 times a power of ten.
    pub step_m: f64,
    /// Decimals that the step needs.
    pub decimals: usize,
    /// The lines of components that are apart, where they are drawn.
    pub apart: Vec<Vec<[f64; 2]>>,
}

impl View {
    /// The view that holds the drive, and of the map what is near it.
    pub fn from_plot(plot: &Plot<'_>) -> Self {
        let mut drive = Extent::default();
        plot.estimate.iter().flatten().for_each(|p| drive.add(*p));
        plot.live.iter().flatten().for_each(|p| drive.add(*p));
        plot.truth.iter().for_each(|p| drive.add(*p));
        let drive = drive.or_origin();
        let near = drive.grown((drive.longer() * MAP_MARGIN).max(MAP_MARGIN_MIN_M));
        let mut all = drive;
        for point in plot.map.iter().filter(|point| near.holds(**point)) {
            all.add(*point);
        }
        let apart = all.place_apart(plot.apart);
        apart.iter().flatten().for_each(|p| all.add(*p));
        let all = all.grown((all.longer() * MARGIN).max(MARGIN_MIN_M));

        let drawing_width = f64::from(WIDTH - EDGE - LEFT - RIGHT);
        let [width_m, height_m] = all.size();
        let drawing_height = (drawing_width * height_m / width_m)
            .clamp(HEIGHT_MIN, HEIGHT_MAX)
            .round();
        let m_per_pixel = (width_m / drawing_width).max(height_m / drawing_height);
        let around = |middle: f64, size_m: f64| middle - 0.5 * size_m..middle + 0.5 * size_m;
        let [x_m, y_m] = all.middle();
        let (step_m, decimals) = step(m_per_pixel * drawing_width.max(drawing_height), GRID_LINES);
        Self {
            x_m: around(x_m, m_per_pixel * drawing_width),
            y_m: around(y_m, m_per_pixel * drawing_height),
            height: TOP + BOTTOM + EDGE + drawing_height as u32,
            step_m,
            decimals,
            apart,
        }
    }

    /// The grid's lines inside a range.
    pub fn lines(&self, range: &Range<f64>) -> Vec<f64> {
        ticks::within(range, self.step_m)
    }
}

/// Whether a point can be in a picture: not NaN, and no farther than anything on Earth.
pub(crate) fn is_drawable(point: &[f64; 2]) -> bool {
    point.iter().all(|c| c.abs() <= POSITION_MAX_M)
}

/// Smallest rectangle around points.
#[derive(Clone, Copy, Debug)]
struct Extent {
    least: [f64; 2],
    most: [f64; 2],
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            least: [f64::INFINITY; 2],
            most: [f64::NEG_INFINITY; 2],
        }
    }
}

impl Extent {
    fn add(&mut self, point: [f64; 2]) {
        if is_drawable(&point) {
            self.least = [self.least[0].min(point[0]), self.least[1].min(point[1])];
            self.most = [self.most[0].max(point[0]), self.most[1].max(point[1])];
        }
    }

    /// The origin, where there are no points.
    fn or_origin(mut self) -> Self {
        if self.least[0] > self.most[0] {
            self.add([0.0, 0.0]);
        }
        self
    }

    fn grown(&self, by_m: f64) -> Self {
        Self {
            least: self.least.map(|c| c - by_m),
            most: self.most.map(|c| c + by_m),
        }
    }

    fn holds(&self, point: [f64; 2]) -> bool {
        let inside =
            |axis: usize| self.least[axis] <= point[axis] && point[axis] <= self.most[axis];
        inside(0) && inside(1)
    }

    fn size(&self) -> [f64; 2] {
        [self.most[0] - self.least[0], self.most[1] - self.least[1]]
    }

    fn longer(&self) -> f64 {
        self.size()[0].max(self.size()[1])
    }

    /// Moves components to the right of this: one below the other from its top on, and in another
    /// column where they would lie below its bottom.
    fn place_apart(&self, components: &[Vec<Vec<[f64; 2]>>]) -> Vec<Vec<[f64; 2]>> {
        let gap_m = (self.longer() * APART).max(APART_MIN_M);
        let [mut left_m, mut top_m] = [self.most[0] + gap_m, self.most[1]];
        let mut widest_m: f64 = 0.0;
        let mut placed = Vec::new();
        for lines in components {
            let mut extent = Self::default();
            lines.iter().flatten().for_each(|p| extent.add(*p));
            let extent = extent.or_origin();
            let [width_m, height_m] = extent.size();
            if top_m < self.most[1] && top_m - height_m < self.least[1] {
                (left_m, top_m) = (left_m + widest_m + gap_m, self.most[1]);
                widest_m = 0.0;
            }
            widest_m = widest_m.max(width_m);
            let by_m = [left_m - extent.least[0], top_m - extent.most[1]];
            let moved = |p: &[f64; 2]| [p[0] + by_m[0], p[1] + by_m[1]];
            placed.extend(lines.iter().map(|line| line.iter().map(moved).collect()));
            top_m -= height_m + gap_m;
        }
        placed
    }

    fn middle(&self) -> [f64; 2] {
        [
            0.5 * (self.most[0] + self.least[0]),
            0.5 * (self.most[1] + self.least[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(estimate: Vec<[f64; 2]>) -> View {
        View::from_plot(&Plot {
            estimate: &[estimate],
            ..Plot::default()
        })
    }

    #[test]
    fn a_metre_is_as_long_in_x_as_in_y() {
        for estimate in [
            vec![[0.0, 0.0], [100.0, 3.0]],
            vec![[0.0, 0.0], [3.0, 100.0]],
            vec![[5.0, 5.0]],
            vec![],
            vec![[f64::NAN, 0.0], [1e8, -1e8]],
        ] {
            let view = view(estimate);
            let width = f64::from(WIDTH - EDGE - LEFT - RIGHT);
            let height = f64::from(view.height - TOP - BOTTOM - EDGE);
            let x = (view.x_m.end - view.x_m.start) / width;
            let y = (view.y_m.end - view.y_m.start) / height;
            assert!((x / y - 1.0).abs() < 1e-9, "{view:?}");
            let lines = view.lines(&view.x_m).len().max(view.lines(&view.y_m).len());
            assert!((3..=12).contains(&lines), "{lines} lines, {view:?}");
        }
    }

    #[test]
    fn components_apart_lie_beside_the_rest_and_below_one_another() {
        let line = |size: f64| vec![vec![[-size, 0.0], [size, size]]];
        let view = View::from_plot(&Plot {
            estimate: &[vec![[0.0, 0.0], [30.0, 20.0]]],
            apart: &[line(4.0), line(3.0)],
            ..Plot::default()
        });
        let placed = [
            vec![[32.0, 16.0], [40.0, 20.0]],
            vec![[32.0, 11.0], [38.0, 14.0]],
        ];
        assert_eq!(view.apart, placed);
        assert!(view.x_m.end > 40.0);
    }

    #[test]
    fn many_components_apart_do_not_hide_the_rest() {
        let apart: Vec<_> = (0..80)
            .map(|_| vec![vec![[0.0, 0.0], [1.0, 1.0]]])
            .collect();
        let view = View::from_plot(&Plot {
            estimate: &[vec![[0.0, 0.0], [30.0, 20.0]]],
            apart: &apart,
            ..Plot::default()
        });
        let mut extent = Extent::default();
        view.apart.iter().flatten().for_each(|p| extent.add(*p));
        // Seven in a column of three metres each, twelve columns.
        assert_eq!((extent.least[1], extent.most[1]), (1.0, 20.0));
        assert_eq!(
            (extent.least[0], extent.most[0]),
            (32.0, 32.0 + 11.0 * 3.0 + 1.0)
        );
    }

    #[test]
    fn far_points_of_the_map_do_not_shrink_the_drive() {
        let view = View::from_plot(&Plot {
            estimate: &[vec![[0.0, 0.0], [17.0, 0.0]]],
            map: &[[90.0, 0.0], [20.0, 5.0]],
            ..Plot::default()
        });
        assert!(view.x_m.end < 40.0);
    }
}

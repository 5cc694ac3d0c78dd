//! A scan's points become NDT cells (RaNDT, III-B).

use super::window_scan::CELLS;
use crate::deskew::Point;
use nalgebra::Vector2;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{Cell, Grid, ScanCell};

/// Makes NDT cells of a scan's de-skewed points, with their derivatives by the velocity.
#[derive(Clone, Debug)]
pub struct NdtBuilder {
    grid: Grid,
    /// By cell: the sum over its points of their derivatives by the velocity, s.
    velocity_jacobians_s: Vec<f64>,
    azimuth_sigma_rad: f64,
}

impl NdtBuilder {
    /// A grid around the robot.
    pub fn new(config: &Config) -> Self {
        let grid = Grid::new(config.scan_extent_m(), config.cell_rule());
        Self {
            grid,
            velocity_jacobians_s: Vec::with_capacity(CELLS),
            azimuth_sigma_rad: config.sensor.azimuth_sigma_rad,
        }
    }

    /// The cells of `points`, in the robot's frame and in order of their first point, cut by
    /// squares along the robot's axes that stay in place while it drives straight on.
    ///
    /// A wall is cut to pieces, and the middle of a piece shows where its square is: squares that
    /// move with the robot pull its pose towards standing still.
    pub fn build(&mut self, points: &[Point], submap_from_base: &Pose2, cells: &mut Vec<ScanCell>) {
        let offset_m = self.within_a_square(submap_from_base);
        self.grid.clear();
        self.velocity_jacobians_s.clear();
        for point in points {
            let position_m = Vector2::new(point.x_m, point.y_m) + offset_m;
            let point_of_cell = [point.x_m, point.y_m, point.intensity];
            let index = self.grid.add_in_square_at(position_m.into(), point_of_cell);
            let Some(index) = index else {
                continue;
            };
            if index == self.velocity_jacobians_s.len() {
                self.velocity_jacobians_s.push(0.0);
            }
            if let Some(sum_s) = self.velocity_jacobians_s.get_mut(index) {
                *sum_s += point.velocity_jacobian_s;
            }
        }
        self.grid.refresh();
        cells.clear();
        cells.extend(
            self.velocity_jacobians_s
                .iter()
                .enumerate()
                .filter_map(|(index, sum_s)| {
                    let cell: &Cell = self.grid.cell(index)?;
                    let mean_s = sum_s / f64::from(cell.count);
                    Some(ScanCell::new(
                        &blurred(cell, self.azimuth_sigma_rad),
                        mean_s,
                    ))
                }),
        );
    }

    /// Where the robot is in the submap, along the robot's axes and without whole squares, m.
    fn within_a_square(&self, submap_from_base: &Pose2) -> Vector2<f64> {
        let along_axes = submap_from_base.rotation().transpose() * submap_from_base.translation();
        along_axes.map(|position_m| position_m.rem_euclid(self.grid.cell_size_m()))
    }
}

/// Widens a cell across the line of sight: a radar is exact in range and poor in azimuth, and the
/// error grows with range.
fn blurred(cell: &Cell, azimuth_sigma_rad: f64) -> Cell {
    let mut cell = *cell;
    // (-y, x) sigma is the tangent of the cell's distance, scaled.
    let (tx, ty) = (
        -azimuth_sigma_rad * cell.mean[1],
        azimuth_sigma_rad * cell.mean[0],
    );
    cell.covariance[0] += tx * tx;
    cell.covariance[1] += tx * ty;
    cell.covariance[2] += ty * ty;
    cell
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_along_the_way_is_cut_where_it_was_before() {
        let config = Config::default();
        let mut builder = NdtBuilder::new(&config);
        // Points of a wall, and the squares' edges, lie where the robot's way does not move them.
        let mut middles = |x_m: f64, yaw_rad: f64| {
            let along = Pose2::new(0.0, 0.0, yaw_rad).transform(Vector2::new(x_m, 0.0));
            let submap_from_base = Pose2::new(along.x, along.y, yaw_rad);
            let wall = (0..400).map(|number| Point {
                x_m: 0.01 * f64::from(number) - x_m,
                y_m: 2.3,
                intensity: 20.0,
                ..Point::default()
            });
            let mut cells = Vec::new();
            builder.build(&wall.collect::<Vec<_>>(), &submap_from_base, &mut cells);
            let middles = cells.iter().map(|scan| scan.cell.mean[0] + x_m);
            middles.collect::<Vec<_>>()
        };
        for yaw_rad in [0.0, 0.7, 3.0] {
            let before = middles(0.0, yaw_rad);
            assert!(before.len() >= 4);
            for x_m in [0.13, 0.5, 1.9] {
                let after = middles(x_m, yaw_rad);
                let close = |(a, b): (&f64, &f64)| (a - b).abs() < 0.02;
                assert!(before.iter().zip(&after).all(close), "{before:?} {after:?}");
            }
        }
    }

    #[test]
    fn a_cell_is_blurred_across_the_line_of_sight_alone() {
        let cell = Cell {
            mean: [6.0, 8.0, 9.0],
            covariance: [0.02, 0.0, 0.02, 0.0, 0.0, 1.0],
            count: 9,
        };
        let [xx, xy, yy, ..] = blurred(&cell, 0.01).covariance;
        let along = |x: f64, y: f64| x * x * xx + 2.0 * x * y * xy + y * y * yy;
        assert!((along(0.6, 0.8) - 0.02).abs() < 1e-12);
        assert!((along(-0.8, 0.6) - (0.02 + 0.1 * 0.1)).abs() < 1e-12);
    }
}

//! Cauchy-Schwarz divergence between two mixtures of normal distributions, in closed form (Kampa
//! et al. 2011).
//!
//! D = -ln( <p, q> / sqrt(<p, p> <q, q>) ) with <p, q> = sum_i sum_j w_i w_j N(mu_i; nu_j, S_i +
//! T_j): 0 where the mixtures are equal, growing as they part. All three products use the sums of
//! both covariances; far pairs vanish.

use randt_geometry::{
    Pose2,
    elementary::{exp, ln},
};
use randt_ndt::{Cell, Grid, scalar};

/// Squares to each side within which pairs count: beyond one cell's edge a wall's distribution has
/// vanished.
const RADIUS: i64 = 1;
/// Stands for mixtures that have nothing in common.
pub const APART: f64 = 50.0;

/// The divergence between the cells of a query submap, moved by `pose`, and those of a map within
/// `range_used_m` of the pose.
pub fn divergence(map: &Grid, query: &Grid, pose: &Pose2, range_used_m: f64) -> f64 {
    let near = |cell: &Cell, x: f64, y: f64| {
        let (dx, dy) = (cell.mean[0] - x, cell.mean[1] - y);
        dx * dx + dy * dy <= range_used_m * range_used_m
    };
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    let (mut trail_points, mut map_points) = (0.0, 0.0);
    for cell in query.cells().filter(|cell| near(cell, 0.0, 0.0)) {
        let count = f64::from(cell.count);
        trail_points += count;
        query.for_each_near(cell.mean[0], cell.mean[1], RADIUS, |_, twin| {
            own += count * f64::from(twin.count) * product(cell, twin);
        });
        let moved = scalar::moved(cell, pose);
        map.for_each_near(moved.mean[0], moved.mean[1], RADIUS, |_, twin| {
            both += count * f64::from(twin.count) * product(&moved, twin);
        });
    }
    for cell in map.cells().filter(|cell| near(cell, pose.x_m, pose.y_m)) {
        let count = f64::from(cell.count);
        map_points += count;
        map.for_each_near(cell.mean[0], cell.mean[1], RADIUS, |_, twin| {
            other += count * f64::from(twin.count) * product(cell, twin);
        });
    }
    // The weights' scales cancel: <p, q> / sqrt(<p, p> <q, q>).
    if both <= 0.0 || own <= 0.0 || other <= 0.0 || trail_points * map_points <= 0.0 {
        return APART;
    }
    (0.5 * (ln(own) + ln(other)) - ln(both)).clamp(0.0, APART)
}

/// N(mu; nu, S + T) but for the factor (2 pi)^(-3/2), which cancels.
fn product(a: &Cell, b: &Cell) -> f64 {
    let [xx, xy, yy, xi, yi, ii] = core::array::from_fn(|k| a.covariance[k] + b.covariance[k]);
    let determinant =
        xx * (yy * ii - yi * yi) + xy * (xi * yi - xy * ii) + xi * (xy * yi - yy * xi);
    if determinant <= 0.0 {
        return 0.0;
    }
    exp(-0.5 * scalar::squared_distance(a, b)) / determinant.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_ndt::CellRule;

    fn grid(cell_size_m: f64, points_min: u32) -> Grid {
        let rule = CellRule {
            points_min,
            use_intensity: true,
            cell_size_m,
            slack: 0.0,
        };
        Grid::new(8.0, rule)
    }

    fn corner(shift: f64) -> Grid {
        let mut grid = grid(1.0, 4);
        for i in 0..600 {
            let s = f64::from(i) * 0.01 - 3.0;
            let rough = f64::from((i * 37) % 11) * 0.01;
            grid.add([s + shift, 2.5 + rough, 10.0 + 40.0 * rough]);
            grid.add([3.5 + rough + shift, s, 18.0 - 20.0 * rough]);
        }
        grid.refresh();
        grid
    }

    #[test]
    fn it_is_zero_for_equals_and_grows_as_they_part() {
        let map = corner(0.0);
        let at = |x: f64, yaw: f64| divergence(&map, &map, &Pose2::new(x, 0.0, yaw), 20.0);
        assert!(at(0.0, 0.0) < 1e-9);
        assert!(at(0.05, 0.0) > 1e-3 && at(0.05, 0.0) < at(0.2, 0.0));
        assert!(at(0.2, 0.0) < at(0.0, 0.4));
        assert_eq!(at(100.0, 0.0), APART);
    }

    #[test]
    fn it_is_the_formula_of_two_single_normals() {
        let cell = |x: f64| {
            let mut grid = grid(4.0, 2);
            for corner in 0..8 {
                let sign = |bit: i32| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
                grid.add([1.0 + x + 0.2 * sign(0), 1.0 + 0.1 * sign(1), 5.0 + sign(2)]);
            }
            grid.refresh();
            grid
        };
        let (p, q) = (cell(0.0), cell(0.3));
        // Equal covariances S: D = d^T (2 S)^-1 d / 2.
        let (a, b) = (p.cells().next().unwrap(), q.cells().next().unwrap());
        let expected = 0.5 * scalar::squared_distance(a, b);
        let found = divergence(&q, &p, &Pose2::IDENTITY, 20.0);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

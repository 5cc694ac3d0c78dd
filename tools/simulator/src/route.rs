//! A closed route: rounded corners, and the point that a driver steers towards.

use nalgebra::Vector2;

/// A closed line with rounded corners, densely sampled.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    points: Vec<Vector2<f64>>,
    // Index of the point that the robot steers towards.
    target: usize,
    laps: u32,
}

impl Route {
    /// Rounds the corners (Chaikin's corner cutting). Fewer than three corners make no route.
    pub fn new(corners: &[Vector2<f64>]) -> Self {
        let mut points = corners.to_vec();
        for _ in 0..4 {
            let pairs = points.iter().zip(points.iter().cycle().skip(1));
            let cut = pairs.flat_map(|(a, b)| [a * 0.75 + b * 0.25, a * 0.25 + b * 0.75]);
            points = cut.collect();
        }
        if corners.len() < 3 {
            points.clear();
        }
        Self {
            points,
            target: 0,
            laps: 0,
        }
    }

    /// Where the route begins and which way it goes; the origin, along x, where there is none.
    pub fn start(&self) -> (Vector2<f64>, Vector2<f64>) {
        match (self.points.first(), self.points.get(1)) {
            (Some(a), Some(b)) => (*a, b - a),
            _ => (Vector2::zeros(), Vector2::x()),
        }
    }

    /// Times that the driver has passed its end.
    pub fn laps(&self) -> u32 {
        self.laps
    }

    /// The first point ahead that is at least `distance_m` away; it only ever moves forward.
    pub fn ahead(&mut self, from: Vector2<f64>, distance_m: f64) -> Option<Vector2<f64>> {
        for _ in 0..self.points.len() {
            let point = *self.points.get(self.target)?;
            if (point - from).norm() >= distance_m {
                return Some(point);
            }
            self.target += 1;
            if self.target == self.points.len() {
                self.target = 0;
                self.laps += 1;
            }
        }
        None
    }
}

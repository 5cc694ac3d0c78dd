//! Poses on a lattice: the grid sees a keyframe move only when it moves by a part of a cell.

use randt_geometry::Pose2;
use randt_geometry::elementary::{sin_cos, wrap};
use std::f64::consts::TAU;

/// Steps of position in a cell: a pose is rounded by an eighth of a cell at most, far below a
/// radar's own error.
const STEPS_PER_CELL: f64 = 4.0;
/// Steps of heading in a turn: a return at 12 m is moved by 9 mm at most, an eighth of a usual
/// cell and less.
const STEPS_PER_TURN: f64 = 4096.0;
/// Nothing that is mapped lies farther from the origin, cells: 1,000 km of cells of 0.1 m.
const CELLS_MAX: f64 = 1e7;

/// A rounded pose. Equal ones paint the same, so that the grid depends on where keyframes are,
/// never on where they were before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LatticePose {
    x: i32,
    y: i32,
    yaw: i32,
}

impl LatticePose {
    /// The nearest one; `None` for a pose that is not finite or farther than any map.
    pub fn nearest(pose: &Pose2, cell_size_m: f64) -> Option<Self> {
        let [x, y] = [pose.x_m, pose.y_m].map(|c| c / cell_size_m);
        let is_near = |c: f64| c.abs() <= CELLS_MAX;
        (is_near(x) && is_near(y) && pose.yaw_rad.is_finite()).then(|| Self {
            x: (x * STEPS_PER_CELL).round() as i32,
            y: (y * STEPS_PER_CELL).round() as i32,
            yaw: (wrap(pose.yaw_rad) / TAU * STEPS_PER_TURN).round() as i32,
        })
    }

    /// The motion that it stands for, in cells.
    pub fn placement(self) -> Placement {
        let (sin, cos) = sin_cos(f64::from(self.yaw) / STEPS_PER_TURN * TAU);
        Placement {
            x: f64::from(self.x) / STEPS_PER_CELL,
            y: f64::from(self.y) / STEPS_PER_CELL,
            cos,
            sin,
        }
    }
}

/// A rigid motion whose unit is a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    x: f64,
    y: f64,
    cos: f64,
    sin: f64,
}

impl Placement {
    /// A point of the keyframe in the map.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.cos * x - self.sin * y + self.x,
            self.sin * x + self.cos * y + self.y,
        ]
    }
}

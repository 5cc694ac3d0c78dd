//! A world: walls as line segments, ground, and a route through them. Plain data.

use crate::{Drive, Ground, Material, Robot};
use nalgebra::Vector2;

/// A straight piece of wall, seen from above; has no thickness and stands upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, m.
    pub from_m: Vector2<f64>,
    /// The other end, m.
    pub to_m: Vector2<f64>,
    /// What it is made of.
    pub material: Material,
}

/// Walls, ground, and a closed route that a robot can drive without end.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Short name.
    pub name: String,
    /// The walls.
    pub walls: Vec<Wall>,
    /// Corners of the route, m; the last is followed by the first.
    pub route_m: Vec<Vector2<f64>>,
    /// Relief under it all.
    pub ground: Ground,
    /// How fast a robot drives here at most.
    pub speed_max_m_s: f64,
}

impl Default for World {
    /// Nothing on level ground, and a robot at walking pace.
    fn default() -> Self {
        Self {
            name: String::new(),
            walls: Vec::new(),
            route_m: Vec::new(),
            ground: Ground::default(),
            speed_max_m_s: 1.0,
        }
    }
}

/// Names and texts of the worlds that come with the program.
const BUILT_IN: [(&str, &str); 3] = [
    ("building", include_str!("../worlds/building.world")),
    ("yard", include_str!("../worlds/yard.world")),
    ("tunnel", include_str!("../worlds/tunnel.world")),
];

impl World {
    /// The names that [`World::named`] knows.
    pub const NAMES: [&'static str; 3] = [BUILT_IN[0].0, BUILT_IN[1].0, BUILT_IN[2].0];

    /// How far a point is from the nearest wall, m; infinite where there is none.
    pub fn clearance_m(&self, point_m: Vector2<f64>) -> f64 {
        let distance_m = |wall: &Wall| {
            let along = wall.to_m - wall.from_m;
            let share = (point_m - wall.from_m).dot(&along) / along.norm_squared();
            let nearest = wall.from_m + along * share.clamp(0.0, 1.0);
            (point_m - nearest).norm()
        };
        // A wall without length has no nearest point: NaN is never the least.
        let distances_m = self.walls.iter().map(distance_m);
        distances_m.fold(f64::INFINITY, f64::min)
    }

    /// The world of a name; `None` for any other.
    pub fn named(name: &str) -> Option<Self> {
        let (name, text) = BUILT_IN.iter().find(|(known, _)| *known == name)?;
        // A test reads every one of them.
        Self::parse(name, text).ok()
    }

    /// Sweeps of a drive that goes round twice and a little farther.
    pub fn sweeps(&self) -> u64 {
        /// Any seed will do: drivers differ by a few per cent, which the share on top covers.
        const SEED: u64 = 1;
        const SHARE: f64 = 1.1;
        const LAPS: u32 = 2;
        /// An hour, for a driver that never completes a lap.
        const SECONDS_MAX: i64 = 3600;
        let robot = Robot::for_world(self);
        let mut drive = Drive::new(self, robot.motion, SEED);
        let mut seconds = 0;
        while drive.laps() < LAPS && seconds < SECONDS_MAX {
            seconds += 1;
            drive.at(seconds * 1_000_000_000);
        }
        let sweeps = seconds as f64 * 1e9 / robot.radar.period_ns as f64 * SHARE;
        // Round figures are easier to remember.
        (sweeps / 50.0).ceil() as u64 * 50
    }

    /// The world `building`.
    pub fn building() -> Self {
        Self::named("building").unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_world_that_comes_with_the_program_can_be_read() {
        for (name, text) in BUILT_IN {
            let world = World::parse(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(World::named(name), Some(world));
        }
        assert_eq!(World::named("castle"), None);
        assert!(!World::building().walls.is_empty());
    }
}

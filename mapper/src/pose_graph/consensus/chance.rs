//! Whether a loop can lie within its gate by chance.
//!
//! Loops of a cluster support each other. One alone has nothing but its gate, and where odometry
//! has drifted far that is as wide as the map: of many false loops some lie in it.

use super::uncertain::Innovation;
use randt_geometry::{Pose2, elementary::PI};

/// False loops that may lie in such a gate by chance, expected. With 0.02 a loop that is 0.59 m
/// off enters M3500; with 0.005 two of its 1,954 true ones stay out where there are 1,368 false
/// ones, and none of the other public graphs'.
const EXPECTED_MAX: f64 = 0.005;
/// Least extent of a map to either side, m: false loops within a room are off by its size.
const EXTENT_MIN_M: f64 = 10.0;

/// Loops that may be false, and what they are spread over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chance {
    /// How many.
    loops: f64,
    /// Relative poses that they may have: the map's area, m^2, by all headings, rad.
    spread: f64,
}

impl Chance {
    /// Of this many loops within the extent of these poses.
    pub fn new(loops: usize, poses: &[Pose2]) -> Self {
        let extent_m = |value: fn(&Pose2) -> f64| {
            let values = || poses.iter().map(value);
            let largest = values().fold(f64::NEG_INFINITY, f64::max);
            let least = values().fold(f64::INFINITY, f64::min);
            (largest - least).max(EXTENT_MIN_M)
        };
        Self {
            loops: loops as f64,
            spread: extent_m(|pose| pose.x_m) * extent_m(|pose| pose.y_m) * 2.0 * PI,
        }
    }

    /// Whether none of them would be in this gate, most probably.
    pub fn is_out(&self, innovation: &Innovation, gate: f64) -> bool {
        let ellipsoid = 4.0 / 3.0 * PI * gate * gate.sqrt() * innovation.volume;
        self.loops * ellipsoid <= EXPECTED_MAX * self.spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_as_wide_as_the_map_proves_nothing() {
        let map = [Pose2::IDENTITY, Pose2::new(50.0, 20.0, 0.0)];
        let gate = |sigma_m: f64| Innovation {
            chi2: 1.0,
            volume: sigma_m * sigma_m * 0.02,
        };
        let (few, many) = (Chance::new(2, &map), Chance::new(500, &map));
        assert!(few.is_out(&gate(0.5), 16.3) && !many.is_out(&gate(0.5), 16.3));
        assert!(many.is_out(&gate(0.05), 16.3) && !few.is_out(&gate(10.0), 16.3));
        // Not a number is no proof.
        assert!(!few.is_out(&gate(f64::NAN), 16.3));
    }
}

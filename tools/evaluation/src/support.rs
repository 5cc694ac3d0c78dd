//! Whether what a scan shows holds the robot in every direction: by the truth of a simulation, not
//! by what an estimate makes of the scan.

use randt_geometry::elementary::{PI, atan2, sin_cos};

/// That many beams have to fall on surfaces that face the weaker direction.
const HELD_BEAMS: usize = 10;

/// What the surfaces of a scan say of its weaker direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DirectionalSupport {
    /// The weaker direction, rad, -pi/2 to pi/2, in the frame of the normals: the eigenvector of
    /// the smaller eigenvalue of the sum of n n^T over the beams' normals n.
    pub weak_direction_rad: f64,
    /// Beams on surfaces whose normals lie within 45 degrees of it, either way.
    pub beams: usize,
}

impl DirectionalSupport {
    /// Of the unit normals of the surfaces that the beams of a scan fall on, one a beam.
    pub fn from_normals(normals: impl Iterator<Item = [f64; 2]> + Clone) -> Self {
        let (mut difference, mut product) = (0.0, 0.0);
        for [x, y] in normals.clone() {
            difference += x * x - y * y;
            product += 2.0 * x * y;
        }
        // Half the angle of the sum of squares is the stronger direction; the weaker one lies
        // across.
        let stronger_rad = 0.5 * atan2(product, difference);
        let weak_direction_rad = if stronger_rad > 0.0 {
            stronger_rad - 0.5 * PI
        } else {
            stronger_rad + 0.5 * PI
        };
        let (sin, cos) = sin_cos(weak_direction_rad);
        let faces = |[x, y]: &[f64; 2]| 2.0 * (x * cos + y * sin) * (x * cos + y * sin) >= 1.0;
        Self {
            weak_direction_rad,
            beams: normals.filter(faces).count(),
        }
    }

    /// Whether it holds the robot in its weaker direction too.
    pub fn is_held(&self) -> bool {
        self.beams >= HELD_BEAMS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// That many beams on surfaces of each normal, given by its angle in degrees.
    fn support(surfaces: &[(usize, f64)]) -> DirectionalSupport {
        let normals = surfaces.iter().flat_map(|(beams, angle_deg)| {
            let (sin, cos) = sin_cos(angle_deg.to_radians());
            std::iter::repeat_n([cos, sin], *beams)
        });
        DirectionalSupport::from_normals(normals)
    }

    #[test]
    fn ten_beams_on_an_end_wall_hold_a_corridor() {
        // Walls to both sides of x.
        let corridor = |end_wall| support(&[(50, 90.0), (50, -90.0), (end_wall, 180.0)]);
        assert!(corridor(0).weak_direction_rad.abs() < 1e-12);
        for (beams, is_held) in [(0, false), (9, false), (10, true)] {
            let found = corridor(beams);
            assert_eq!((found.beams, found.is_held()), (beams, is_held));
        }
        // A niche under 50 degrees to the wall faces along it, one under 40 degrees does not.
        assert!(support(&[(50, 90.0), (50, -90.0), (10, 140.0)]).is_held());
        assert!(!support(&[(60, 90.0), (60, -90.0), (10, 130.0)]).is_held());
    }

    #[test]
    fn the_weaker_direction_turns_with_the_walls() {
        for turn_deg in [-80.0, -30.0, 0.0, 30.0, 80.0] {
            let walls = [(40, 90.0 + turn_deg), (40, -90.0 + turn_deg)];
            let found = support(&walls).weak_direction_rad.to_degrees();
            assert!((found - turn_deg).abs() < 1e-9, "{turn_deg} {found}");
        }
        assert_eq!(support(&[]).beams, 0);
    }
}

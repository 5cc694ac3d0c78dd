//! Which directions of the position a scan sees by itself.

use nalgebra::{Matrix2, Matrix3, SymmetricEigen, Vector2};
use randt_config::Config;
use randt_geometry::{
    elementary::{atan2, sin_cos},
    marginalize_yaw,
};
use randt_messages::Localizability as Seen;
use randt_persist::{Error, Persist, Reader, Writer};
use std::f64::consts::FRAC_PI_2;

/// A direction is weak where a scan's information along it is below this many times what the grid
/// alone seems to give along a bare wall. Simulated corridors, whose ends are out of sight, have
/// 1.2 to 1.6 times that, places with corners over 16 times; at 5.6 times, 0.07 % of the scans of
/// eleven sound drives are called weak at most.
const WEAK_MAX: f64 = 5.6;

/// Cells that a scan needs to fix a pose at all.
pub const CELLS_MIN: usize = 5;

/// What a scan says of the position, its yaw marginalised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Localizability {
    /// Which directions it sees.
    pub seen: Seen,
    /// The direction that it does not see, in the robot's frame, from -pi/2 to pi/2; 0 unless one
    /// is seen and the other is not.
    pub weak_direction_rad: f64,
}

impl Localizability {
    /// Nothing is seen.
    pub const NONE: Self = Self {
        seen: Seen::None,
        weak_direction_rad: 0.0,
    };

    /// From a scan's information about its pose, in its own frame, and its fit.
    pub fn from_information(information: &Matrix3<f64>, fit: f64, config: &Config) -> Self {
        let weak_max = WEAK_MAX * wall_information(fit, config);
        let [weaker, stronger] = position_information(information);
        // Without a fit both are 0: nothing is seen.
        let seen = match (weaker <= weak_max, stronger <= weak_max) {
            (false, _) => Seen::Full,
            (true, false) => Seen::Partial,
            (true, true) => Seen::None,
        };
        let is_partial = seen == Seen::Partial;
        Self {
            seen,
            weak_direction_rad: if is_partial {
                weaker_direction(information)
            } else {
                0.0
            },
        }
    }

    /// Projection onto what is not seen, in the robot's frame.
    pub fn unseen(&self) -> Matrix2<f64> {
        match self.seen {
            Seen::Partial => {
                let (sin, cos) = sin_cos(self.weak_direction_rad);
                let along = Vector2::new(cos, sin);
                along * along.transpose()
            }
            Seen::None => Matrix2::identity(),
            Seen::Full | Seen::Unknown => Matrix2::zeros(),
        }
    }
}

impl Persist for Localizability {
    fn save(&self, out: &mut Writer<'_>) {
        (self.seen as u32).save(out);
        self.weak_direction_rad.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let mut code = 0_u32;
        code.restore(from)?;
        self.seen = Seen::from_code(code);
        self.weak_direction_rad.restore(from)
    }
}

/// Eigenvalues of the position information that the scan gives by itself, smaller first, 1/m^2;
/// yaw is marginalised.
pub fn position_information(information: &Matrix3<f64>) -> [f64; 2] {
    let reduced = marginalize_yaw(information);
    let values = SymmetricEigen::new(reduced).eigenvalues;
    [
        values.x.min(values.y).max(0.0),
        values.x.max(values.y).max(0.0),
    ]
}

/// Direction of the smaller one's eigenvector, from -pi/2 to pi/2: across the stronger one's.
pub fn weaker_direction(information: &Matrix3<f64>) -> f64 {
    let information = marginalize_yaw(information);
    let across = 0.5 * atan2(2.0 * information.m12, information.m11 - information.m22);
    if across < 0.0 {
        across + FRAC_PI_2
    } else {
        across - FRAC_PI_2
    }
}

/// Information along a bare wall that comes of the grid alone, 1/m^2.
///
/// The squares of size l cut the wall to pieces whose variance along it is l^2 / 12, widened by
/// 1 + slack. Two of them, the scan's and the map's, make 6 / (l^2 (1 + slack)) of information.
/// The scan's correspondences share the weight of the NDT term, each by its robust weight, whose
/// mean is the fit. As the scan's squares lie where they would if it were where it was predicted,
/// it holds the pose there.
pub fn wall_information(fit: f64, config: &Config) -> f64 {
    let cell_m = config.cell_size_m();
    6.0 * config.odometry.ndt_weight * fit / (cell_m * cell_m * (1.0 + config.ndt.slack))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};
    use std::f64::consts::PI;

    /// What is seen with that much information along a direction and across it, 1/m^2.
    fn seen(direction_rad: f64, along: f64, across: f64) -> Localizability {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), direction_rad);
        let turn = turn.matrix();
        let diagonal = Matrix3::from_diagonal(&Vector3::new(along, across, 1e5));
        let information = turn * diagonal * turn.transpose();
        Localizability::from_information(&information, 0.8, &Config::default())
    }

    #[test]
    fn what_is_below_the_grids_own_information_is_not_seen() {
        assert_eq!(seen(0.3, 1000.0, 9000.0).seen, Seen::Full);
        assert_eq!(seen(0.3, 800.0, 9000.0).seen, Seen::Partial);
        assert_eq!(seen(0.3, 800.0, 850.0).seen, Seen::None);
        for (along, across) in [(1000.0, 9000.0), (800.0, 850.0)] {
            assert_eq!(seen(0.3, along, across).weak_direction_rad, 0.0);
        }
        let nothing = Localizability::from_information(&Matrix3::zeros(), 0.0, &Config::default());
        assert_eq!(nothing.seen, Seen::None);
    }

    #[test]
    fn the_weak_direction_is_along_the_corridor() {
        for degrees in -89..90 {
            let direction_rad = f64::from(degrees).to_radians();
            let found = seen(direction_rad, 100.0, 9000.0).weak_direction_rad;
            assert!((found - direction_rad).abs() < 1e-9, "{degrees}: {found}");
            // It has no sense: a corridor to the back is the same.
            let back = seen(direction_rad + PI, 100.0, 9000.0).weak_direction_rad;
            assert!((back - direction_rad).abs() < 1e-9, "{degrees}: {back}");
        }
        let across = seen(FRAC_PI_2, 100.0, 9000.0).weak_direction_rad;
        assert!((across.abs() - FRAC_PI_2).abs() < 1e-9, "{across}");
    }

    #[test]
    fn yaw_takes_its_part_of_the_information() {
        // What is known of the position ahead only together with yaw is not known of it alone.
        let mut information = Matrix3::from_diagonal(&Vector3::new(9000.0, 9000.0, 1e5));
        let shared = (0.99_f64 * 9000.0 * 1e5).sqrt();
        (information.m13, information.m31) = (shared, shared);
        let found = Localizability::from_information(&information, 0.8, &Config::default());
        assert_eq!(
            (found.seen, found.weak_direction_rad.abs()),
            (Seen::Partial, 0.0)
        );
    }
}

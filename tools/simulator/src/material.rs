//! What walls are made of, as a radar at 24 to 80 GHz sees it.
//!
//! Values are rounded from the radio-propagation literature (ITU-R P.2040 and measurements of
//! indoor materials at 60 GHz): their order and spread matter here, not their second digit.

use randt_geometry::elementary::pow;

/// A material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// Load-bearing: strong, rough, opaque.
    Concrete,
    /// A thin partition: what stands behind it is seen through it.
    Plaster,
    /// Doors and furniture.
    Wood,
    /// Windows: a mirror, weak under any other angle, clear.
    Glass,
    /// Cabinets, radiators, door frames: strong, a mirror, opaque.
    Metal,
}

/// How a material answers, as factors on amplitude.
#[derive(Clone, Copy, Debug)]
pub struct Response {
    /// Echo from a rough surface under normal incidence; falls with the incidence's cosine.
    pub diffuse: f64,
    /// Echo of a smooth surface that is hit at right angles.
    pub specular: f64,
    /// Width of the specular echo: the sine of the incidence at which it has fallen to 1/e.
    pub specular_width: f64,
    /// What remains of an echo that came twice through the wall; 0 where nothing comes through.
    pub through: f64,
    /// What remains of a wave that is thrown on as by a mirror, once.
    pub mirror: f64,
}

impl Material {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Concrete,
        Self::Plaster,
        Self::Wood,
        Self::Glass,
        Self::Metal,
    ];

    /// As worlds name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Concrete => "concrete",
            Self::Plaster => "plaster",
            Self::Wood => "wood",
            Self::Glass => "glass",
            Self::Metal => "metal",
        }
    }

    /// Its response.
    pub fn response(self) -> Response {
        // Diffuse dB, specular dB, specular width, loss of one passage in dB, loss of the mirror
        // in dB.
        let (diffuse, specular, width, passage, mirror) = match self {
            Self::Concrete => (-3.0, 3.0, 0.25, f64::INFINITY, 7.0),
            Self::Plaster => (-8.0, 0.0, 0.18, 4.0, 9.0),
            Self::Wood => (-7.0, -2.0, 0.25, 5.0, 10.0),
            Self::Glass => (-18.0, 3.0, 0.08, 2.5, 6.0),
            Self::Metal => (2.0, 9.0, 0.15, f64::INFINITY, 1.0),
        };
        Response {
            diffuse: amplitude(diffuse),
            specular: amplitude(specular),
            specular_width: width,
            through: amplitude(-2.0 * passage),
            mirror: amplitude(-mirror),
        }
    }
}

/// The factor on amplitude of a level in dB.
pub(crate) fn amplitude(level_db: f64) -> f64 {
    pow(10.0, level_db / 20.0)
}

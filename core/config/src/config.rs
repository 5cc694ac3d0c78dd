//! All sections together, and what must hold between them.

use crate::section::Refusal;
use crate::sections::{Attitude, Filter, Keyframe, Ndt, Odometry, Robot, Sensor, Submap};
use crate::{Error, Key};
use toml::de::DeValue;

/// One documented section.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Name in a file.
    pub name: &'static str,
    /// What it is about; one entry a line.
    pub about: &'static [&'static str],
    /// Its keys, in order.
    pub keys: &'static [Key],
}

/// Declares the configuration from its sections.
macro_rules! config {
    ($( $(#[doc = $doc:literal])+ $name:ident : $section:ident ),+ $(,)?) => {
        /// All that is in force.
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
        pub struct Config { $( $(#[doc = $doc])+ pub $name: $section ),+ }

        impl Config {
            /// Every section, in order.
            pub const SECTIONS: &'static [Section] = &[ $( Section {
                name: stringify!($name),
                about: $section::ABOUT,
                keys: $section::KEYS,
            } ),+ ];

            /// Sets one key, if its type and range allow.
            pub(crate) fn set(
                &mut self,
                section: &str,
                key: &str,
                value: &DeValue<'_>,
            ) -> Result<(), Refusal> {
                match section {
                    $( stringify!($name) => self.$name.set(key, value), )+
                    _ => Err(Refusal::NoSuchKey),
                }
            }

            /// The value of one key as TOML; `None` where there is no such key.
            pub fn get(&self, section: &str, key: &str) -> Option<String> {
                match section {
                    $( stringify!($name) => self.$name.get(key), )+
                    _ => None,
                }
            }
        }
    };
}

config! {
    /// Beam-wise filter.
    filter: Filter,
    /// Attitude filter.
    attitude: Attitude,
    /// Cells.
    ndt: Ndt,
    /// Motion estimation.
    odometry: Odometry,
    /// Keyframes.
    keyframe: Keyframe,
    /// Submaps.
    submap: Submap,
    /// The radar.
    sensor: Sensor,
    /// Mounting.
    robot: Robot,
}

impl Config {
    /// Refuses keys that are good each but contradict each other.
    pub(crate) fn check(&self) -> Result<(), Error> {
        below(
            ("submap.overlap_m", self.submap.overlap_m),
            ("submap.radius_m", self.submap.radius_m),
        )?;
        below(
            ("sensor.range_min_m", self.sensor.range_min_m),
            ("sensor.range_max_m", self.sensor.range_max_m),
        )?;
        below(
            ("sensor.range_min_m", self.sensor.range_min_m),
            ("filter.range_max_m", self.filter.range_max_m),
        )
    }
}

/// The first must be below the second.
fn below(less: (&'static str, f64), more: (&'static str, f64)) -> Result<(), Error> {
    if less.1 < more.1 {
        return Ok(());
    }
    Err(Error::Contradiction {
        less: less.0,
        less_value: less.1,
        more: more.0,
        more_value: more.1,
    })
}

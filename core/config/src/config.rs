//! All sections together, and what must hold between them.

use crate::section::Refusal;
use crate::sections::{
    Attitude, Filter, Grid, ImuDriver, Keyframe, Link, Loops, Ndt, Odometry, RadarDriver, Record,
    Robot, Sensor, Submap, View,
};
use crate::{Error, Key, Origins};
use randt_ndt::CellRule;
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

impl Config {
    /// Edge of an NDT cell, m: the environment's, or the sensor's smallest where that is larger.
    pub fn cell_size_m(&self) -> f64 {
        self.ndt.cell_size_m.max(self.sensor.cell_size_min_m)
    }

    /// Which points make an NDT cell, in scans and submaps alike.
    pub fn cell_rule(&self) -> CellRule {
        CellRule {
            points_min: self.ndt.points_min,
            use_intensity: self.ndt.intensity,
            cell_size_m: self.cell_size_m(),
            slack: self.ndt.slack,
        }
    }

    /// Whether a gap between sweeps is bridged, in which a gyro has given that many samples.
    pub fn bridges_gap(&self, gap_s: f64, gyro_samples: usize) -> bool {
        let odometry = &self.odometry;
        let has_turn = gyro_samples as f64 >= GYRO_HZ_MIN * gap_s;
        let with_gyro_s = odometry.gap_with_gyro_max_s.max(odometry.gap_max_s);
        gap_s
            <= if has_turn {
                with_gyro_s
            } else {
                odometry.gap_max_s
            }
    }

    /// A number that differs where any value differs that is used in computing: FNV-1a over all
    /// keys with their values.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint_of(|section| !DRIVERS.contains(&section))
    }

    /// The same of some sections.
    pub fn fingerprint_of(&self, computes: impl Fn(&str) -> bool) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325;
        for section in Self::SECTIONS.iter().filter(|s| computes(s.name)) {
            for key in section.keys {
                let value = self.get(section.name, key.name).unwrap_or_default();
                for byte in format!("{}.{} = {value}\n", section.name, key.name).bytes() {
                    hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
                }
            }
        }
        hash
    }

    /// Farthest range whose returns are used, m: the environment's, or the sensor's where that is
    /// smaller.
    pub fn range_used_m(&self) -> f64 {
        self.filter.range_max_m.min(self.sensor.range_max_m)
    }
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
    /// Loop closure.
    loops: Loops,
    /// Occupancy grid.
    grid: Grid,
    /// The radar.
    sensor: Sensor,
    /// Mounting.
    robot: Robot,
    /// Radar's driver.
    radar: RadarDriver,
    /// IMU's driver.
    imu: ImuDriver,
    /// What is recorded beside the log.
    record: Record,
    /// What is shown live.
    view: View,
    /// What a base gets.
    link: Link,
}

/// Slowest gyro whose turn over a gap between sweeps is believed, Hz: five samples a sweep.
const GYRO_HZ_MIN: f64 = 25.0;

/// Sections that decide how messages are acquired, not what is computed from them: another address
/// makes the same map.
const DRIVERS: &[&str] = &["radar", "imu", "record", "view", "link"];

/// What must be below what, as section and key.
const BELOW: &[[(&str, &str); 2]] = &[
    [("submap", "overlap_m"), ("submap", "radius_m")],
    [("sensor", "range_min_m"), ("sensor", "range_max_m")],
    [("sensor", "range_min_m"), ("filter", "range_max_m")],
    // Otherwise every bin is a cluster of its own.
    [
        ("sensor", "range_resolution_m"),
        ("sensor", "connectivity_m"),
    ],
];

impl Config {
    /// Refuses keys that are valid each but contradict each other.
    pub(crate) fn check(&self, origins: &Origins) -> Result<(), Error> {
        let number = |(section, key)| self.get(section, key).and_then(|text| text.parse().ok());
        let describe = |(section, key): (&'static str, &'static str)| {
            let location = origins.get(&(section, key)).map(ToString::to_string);
            format!(
                "{section}.{key} = {} ({})",
                self.get(section, key).unwrap_or_default(),
                location.as_deref().unwrap_or("default")
            )
        };
        for &[less, more] in BELOW {
            let (a, b): (Option<f64>, Option<f64>) = (number(less), number(more));
            if a >= b {
                return Err(Error::Contradiction {
                    less: describe(less),
                    more: describe(more),
                });
            }
        }
        for product in self.products() {
            if product.size > product.most {
                return Err(Error::TooLarge {
                    keys: product.keys.into_iter().map(describe).collect(),
                    what: product.what,
                    size: product.size,
                    most: product.most,
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::{Path, PathBuf};

    /// Words of the documentation that begin with a section's name and are messages, files of a
    /// stage, or entries of a report, which the documentation names by their former names too.
    const OTHERS: [&str; 3] = ["link.before-", "odometry.pose", "odometry.state"];
    /// How names of files end that begin like a section.
    const ENDINGS: [&str; 6] = ["csv", "journal", "md", "timestamps", "toml", "tum"];
    const ENTRIES: &str = "loops";

    fn documents(folder: &Path) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            // Decisions say what was, too.
            if path.is_dir() && !path.ends_with("decisions") {
                found.extend(documents(&path));
            } else if path.extension().is_some_and(|ending| ending == "md") {
                found.push(path);
            }
        }
        found
    }

    #[test]
    fn every_key_that_the_documentation_names_exists() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut files = documents(&root.join("docs"));
        files.push(root.join("README.md"));
        let config = Config::default();
        let (mut named, mut unknown) = (0, Vec::new());
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '/' | '-');
            for word in text.split(|c| !is_part(c)) {
                let word = word.trim_end_matches('.');
                let Some((section, key)) = word.split_once('.') else {
                    continue;
                };
                let is_section = Config::SECTIONS.iter().any(|known| known.name == section);
                let is_file = key.split('.').any(|part| ENDINGS.contains(&part));
                let is_other = is_file
                    || section == ENTRIES
                    || OTHERS.iter().any(|other| word.starts_with(other));
                if is_section && !is_other && !key.is_empty() {
                    if config.get(section, key).is_none() {
                        unknown.push(format!("{}: {word}", file.display()));
                    }
                    named += 1;
                }
            }
        }
        assert!(unknown.is_empty(), "{unknown:#?}");
        assert!(named > 30, "{named}");
    }
}

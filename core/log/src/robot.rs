//! The metadata record `randt/robot`: which radar made the log and where the sensors sit.

use crate::Error;
use randt_messages::SensorKind;
use std::collections::BTreeMap;

/// Name of the metadata record.
pub const ROBOT_METADATA: &str = "randt/robot";
/// Name of the record with the configuration of a live run, and its one key.
pub const CONFIG_METADATA: &str = "randt/config";
/// The configuration as TOML.
pub const CONFIG_TOML: &str = "toml";

const SENSOR: &str = "sensor";
const RADAR: &str = "radar_in_base_link_x_m_y_m_yaw_rad";
const IMU: &str = "imu_in_base_link_quaternion_w_x_y_z";

/// The robot that a log was recorded on, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Robot {
    /// The radar.
    pub sensor: SensorKind,
    /// Radar in `base_link`: x m, y m, yaw rad.
    pub radar: Option<[f64; 3]>,
    /// IMU's orientation in `base_link`: quaternion w, x, y, z.
    pub imu: Option<[f64; 4]>,
}

impl Robot {
    /// The record's content. Numbers are written so that they read back to the same bits.
    pub fn to_metadata(&self) -> BTreeMap<String, String> {
        let sensor = self.sensor.as_str().to_owned();
        let mut map = BTreeMap::from([(SENSOR.to_owned(), sensor)]);
        let mut put = |key: &str, numbers: Option<&[f64]>| {
            if let Some(numbers) = numbers {
                let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
                map.insert(key.to_owned(), words.join(" "));
            }
        };
        put(RADAR, self.radar.as_ref().map(<[f64; 3]>::as_slice));
        put(IMU, self.imu.as_ref().map(<[f64; 4]>::as_slice));
        map
    }

    /// Reads the record's content; `path` is named in errors. A key that is missing stays unknown.
    pub fn from_metadata(map: &BTreeMap<String, String>, path: &str) -> Result<Self, Error> {
        let unknown = SensorKind::Unknown.as_str();
        let named = map.get(SENSOR).map_or(unknown, String::as_str);
        let sensor = SensorKind::from_name(named);
        if sensor == SensorKind::Unknown && named != unknown {
            return Err(bad(path, SENSOR, named, "isdr-c, navtech-cts or unknown"));
        }
        Ok(Self {
            sensor,
            radar: numbers(map, RADAR, path, "three finite numbers")?,
            imu: numbers(map, IMU, path, "four finite numbers")?,
        })
    }
}

fn numbers<const N: usize>(
    map: &BTreeMap<String, String>,
    key: &'static str,
    path: &str,
    expected: &'static str,
) -> Result<Option<[f64; N]>, Error> {
    let Some(text) = map.get(key) else {
        return Ok(None);
    };
    let parsed: Vec<f64> = text
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .filter(|number: &f64| number.is_finite())
        .collect();
    match <[f64; N]>::try_from(parsed) {
        Ok(numbers) if text.split_whitespace().count() == N => Ok(Some(numbers)),
        _ => Err(bad(path, key, text, expected)),
    }
}

fn bad(path: &str, key: &'static str, value: &str, expected: &'static str) -> Error {
    Error::Metadata {
        path: path.to_owned(),
        record: ROBOT_METADATA,
        key,
        value: value.to_owned(),
        expected,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_reads_back_to_the_same_bits() {
        let robot = Robot {
            sensor: SensorKind::IsdrC,
            radar: Some([0.1 + 0.2, -1e-17, 3.0]),
            imu: Some([0.0, 1.0, 0.0, -0.0]),
        };
        assert_eq!(
            Robot::from_metadata(&robot.to_metadata(), "x").unwrap(),
            robot
        );
        let unknown = Robot::default();
        assert_eq!(
            Robot::from_metadata(&unknown.to_metadata(), "x").unwrap(),
            unknown
        );
    }

    #[test]
    fn a_wrong_value_is_named() {
        let mut map = Robot::default().to_metadata();
        for value in ["1 2", "1 2 nan", "1 2 3 4", "1 two 3"] {
            map.insert(RADAR.to_owned(), value.to_owned());
            let text = Robot::from_metadata(&map, "a.mcap")
                .unwrap_err()
                .to_string();
            assert!(
                text.contains(value) && text.contains("three finite numbers"),
                "{text}"
            );
        }
    }
}

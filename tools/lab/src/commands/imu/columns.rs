//! Which columns of an IMU table hold stamp, rate and specific force: by the header's names and
//! units.

use std::f64::consts::PI;

const STAMP_NAMES: &[&str] = &["stamp", "timestamp", "time", "t", "header_stamp"];
/// Nanoseconds each; seconds where the name has no unit.
const STAMP_UNITS: &[(&str, f64)] = &[
    ("", 1e9),
    ("s", 1e9),
    ("sec", 1e9),
    ("ms", 1e6),
    ("us", 1e3),
    ("ns", 1.0),
];
const RATE_NAMES: &[&str] = &[
    "w",
    "rate",
    "gyro",
    "gyr",
    "gyroscope",
    "omega",
    "angular_velocity",
    "w_rs_s",
];
/// rad/s each; rad/s where the name has no unit.
const RATE_UNITS: &[(&str, f64)] = &[
    ("", 1.0),
    ("rad_s", 1.0),
    ("rad_s_1", 1.0),
    ("rads", 1.0),
    ("deg_s", PI / 180.0),
    ("deg_s_1", PI / 180.0),
    ("dps", PI / 180.0),
];
const ACCELERATION_NAMES: &[&str] = &[
    "a",
    "acc",
    "accel",
    "acceleration",
    "accelerometer",
    "linear_acceleration",
    "a_rs_s",
];
/// m/s^2 each; m/s^2 where the name has no unit.
const ACCELERATION_UNITS: &[(&str, f64)] = &[
    ("", 1.0),
    ("m_s2", 1.0),
    ("m_s_2", 1.0),
    ("ms2", 1.0),
    ("mps2", 1.0),
    ("g", 9.806_65),
];

/// A column, and what its numbers are multiplied by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    pub index: usize,
    pub scale: f64,
}

/// The columns of a table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    /// How many the table has.
    pub count: usize,
    /// To nanoseconds.
    pub stamp: Column,
    /// To rad/s; x, y, z.
    pub rate: [Column; 3],
    /// To m/s^2; x, y, z.
    pub acceleration: [Column; 3],
}

impl Columns {
    /// Finds them in a header; fails with the names of the first column that is missing.
    pub fn find(header: &[String]) -> Result<Self, String> {
        let header: Vec<String> = header.iter().map(|cell| normal(cell)).collect();
        let find = |names, units, axis| {
            column(&header, names, units, axis).ok_or_else(|| {
                let shown: String = header.join(", ").chars().take(200).collect();
                format!("no column {}; it has {shown}", spelled(names, axis))
            })
        };
        let axes = |names, units| -> Result<[Column; 3], String> {
            Ok([
                find(names, units, "x")?,
                find(names, units, "y")?,
                find(names, units, "z")?,
            ])
        };
        Ok(Self {
            count: header.len(),
            stamp: find(STAMP_NAMES, STAMP_UNITS, "")?,
            rate: axes(RATE_NAMES, RATE_UNITS)?,
            acceleration: axes(ACCELERATION_NAMES, ACCELERATION_UNITS)?,
        })
    }
}

/// A header's cell in small letters with single underscores: `#timestamp [ns]` is `timestamp_ns`.
fn normal(cell: &str) -> String {
    let lower = cell.to_lowercase();
    let parts = lower
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("_")
}

/// The first column that is one of these names, with the axis behind it or behind its unit.
fn column(header: &[String], names: &[&str], units: &[(&str, f64)], axis: &str) -> Option<Column> {
    for name in names {
        for &(unit, scale) in units {
            let spellings = [
                format!("{name}{axis} {unit}"),
                format!("{name} {axis} {unit}"),
                format!("{name} {unit} {axis}"),
            ];
            let found = header
                .iter()
                .position(|cell| spellings.iter().any(|spelling| normal(spelling) == *cell));
            if let Some(index) = found {
                return Some(Column { index, scale });
            }
        }
    }
    None
}

fn spelled(names: &[&str], axis: &str) -> String {
    let with_axis = names.iter().map(|name| {
        if axis.is_empty() {
            (*name).to_owned()
        } else {
            format!("{name}_{axis}")
        }
    });
    with_axis.collect::<Vec<_>>().join(" or ")
}

//! An IMU recording as comma-separated values.
//!
//! Responsible for finding stamp, rate and specific force by the header's names and units, whatever else the
//! table holds. Not responsible for judging the values.

use super::sample::Sample;
use anyhow::{Context, bail};
use nalgebra::Vector3;
use randt_readers::Counter;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Longest line. A file without line ends must not fill the memory.
const LINE_MAX: u64 = 64 * 1024;

const STAMP_NAMES: &[&str] = &["stamp", "timestamp", "time", "t", "header_stamp"];
/// Nanoseconds each; seconds where nothing is said.
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
/// rad/s each; rad/s where nothing is said.
const RATE_UNITS: &[(&str, f64)] = &[
    ("", 1.0),
    ("rad_s", 1.0),
    ("rad_s_1", 1.0),
    ("rads", 1.0),
    ("deg_s", core::f64::consts::PI / 180.0),
    ("deg_s_1", core::f64::consts::PI / 180.0),
    ("dps", core::f64::consts::PI / 180.0),
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
/// m/s^2 each; m/s^2 where nothing is said.
const ACCELERATION_UNITS: &[(&str, f64)] = &[
    ("", 1.0),
    ("m_s2", 1.0),
    ("m_s_2", 1.0),
    ("ms2", 1.0),
    ("mps2", 1.0),
    ("g", 9.806_65),
];

/// A table that is read row by row.
#[derive(Debug)]
pub struct Csv {
    path: String,
    lines: BufReader<File>,
    line: Vec<u8>,
    line_number: u64,
    columns: usize,
    stamp: Column,
    rate: [Column; 3],
    acceleration: [Column; 3],
    bad_rows: u64,
    first_bad: String,
}

#[derive(Clone, Copy, Debug)]
struct Column {
    index: usize,
    scale: f64,
}

impl Csv {
    /// Opens a table and understands its header.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| name.clone())?;
        let mut csv = Self {
            path: name,
            lines: BufReader::new(file),
            line: Vec::new(),
            line_number: 0,
            columns: 0,
            stamp: Column {
                index: 0,
                scale: 1.0,
            },
            rate: [Column {
                index: 0,
                scale: 1.0,
            }; 3],
            acceleration: [Column {
                index: 0,
                scale: 1.0,
            }; 3],
            bad_rows: 0,
            first_bad: String::new(),
        };
        if !csv.read_line()? {
            bail!("{}: is empty; expected a ROS bag or a CSV header", csv.path);
        }
        let header: Vec<String> = String::from_utf8_lossy(&csv.line)
            .split(',')
            .map(normal)
            .collect();
        csv.columns = header.len();
        let find = |names, units, axis| {
            column(&header, names, units, axis).with_context(|| {
                let wanted = spelled(names, axis);
                let shown: String = header.join(", ").chars().take(200).collect();
                format!("{}: line 1: no column {wanted}; it has {shown}", csv.path)
            })
        };
        let axes = |names, units| -> anyhow::Result<[Column; 3]> {
            Ok([
                find(names, units, "x")?,
                find(names, units, "y")?,
                find(names, units, "z")?,
            ])
        };
        (csv.stamp, csv.rate, csv.acceleration) = (
            find(STAMP_NAMES, STAMP_UNITS, "")?,
            axes(RATE_NAMES, RATE_UNITS)?,
            axes(ACCELERATION_NAMES, ACCELERATION_UNITS)?,
        );
        Ok(csv)
    }

    /// The next row that holds numbers; others are counted.
    pub fn next_sample(&mut self) -> anyhow::Result<Option<Sample>> {
        while self.read_line()? {
            let row = String::from_utf8_lossy(&self.line);
            if row.trim().is_empty() {
                continue;
            }
            match self.sample(&row) {
                Ok(sample) => return Ok(Some(sample)),
                Err(problem) => {
                    if self.bad_rows == 0 {
                        self.first_bad =
                            format!("{}: line {}: {problem}", self.path, self.line_number);
                    }
                    self.bad_rows += 1;
                }
            }
        }
        Ok(None)
    }

    /// Rows that were left out.
    pub fn counters(&self) -> Vec<Counter> {
        let bad = (self.bad_rows > 0).then(|| Counter {
            name: "rows_unreadable",
            count: self.bad_rows,
            first: self.first_bad.clone(),
            loss: true,
        });
        bad.into_iter().collect()
    }

    fn sample(&self, row: &str) -> Result<Sample, String> {
        let cells: Vec<&str> = row
            .split(',')
            .map(|cell| cell.trim().trim_matches('"'))
            .collect();
        // A row that lost a piece would give the numbers of another column or of the next row.
        if cells.len() != self.columns {
            return Err(format!(
                "{} columns, expected {}",
                cells.len(),
                self.columns
            ));
        }
        let cell = |column: Column| cells.get(column.index).copied().unwrap_or_default();
        let number = |column: Column| -> Result<f64, String> {
            let text = cell(column);
            match text.parse::<f64>() {
                Ok(value) => Ok(value * column.scale),
                Err(_) => Err(format!(
                    "{:?} is no number",
                    text.chars().take(40).collect::<String>()
                )),
            }
        };
        let vector = |columns: [Column; 3]| -> Result<Vector3<f64>, String> {
            let [x, y, z] = columns;
            Ok(Vector3::new(number(x)?, number(y)?, number(z)?))
        };
        Ok(Sample {
            stamp_ns: stamp_ns(cell(self.stamp), self.stamp.scale)?,
            rate_rad_s: vector(self.rate)?,
            acceleration_m_s2: vector(self.acceleration)?,
        })
    }

    /// Reads a line without its end; false at the end of the file.
    fn read_line(&mut self) -> anyhow::Result<bool> {
        self.line.clear();
        let read = self
            .lines
            .by_ref()
            .take(LINE_MAX)
            .read_until(b'\n', &mut self.line);
        let length = read.with_context(|| self.path.clone())?;
        self.line_number += 1;
        if length as u64 == LINE_MAX && self.line.last() != Some(&b'\n') {
            bail!(
                "{}: line {} is longer than {LINE_MAX} bytes; expected a ROS bag or CSV",
                self.path,
                self.line_number
            );
        }
        Ok(length > 0)
    }
}

/// A stamp without the rounding that a f64 would bring to today's nanoseconds.
fn stamp_ns(text: &str, scale: f64) -> Result<i64, String> {
    let bad = || format!("{:?} is no time", text.chars().take(40).collect::<String>());
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let nanoseconds = match whole.parse::<i64>() {
        Ok(whole) => {
            let part: f64 = if fraction.is_empty() {
                0.0
            } else {
                format!("0.{fraction}").parse().map_err(|_| bad())?
            };
            let part = if text.starts_with('-') { -part } else { part };
            whole
                .checked_mul(scale as i64)
                .and_then(|ns| ns.checked_add((part * scale).round() as i64))
        }
        // Such as 1.5e9.
        Err(_) => text
            .parse()
            .ok()
            .map(|value: f64| value * scale)
            .and_then(|ns| (ns.abs() < i64::MAX as f64).then_some(ns.round() as i64)),
    };
    nanoseconds.ok_or_else(bad)
}

/// A header's cell in small letters with single underscores: `#timestamp [ns]` is `timestamp_ns`.
fn normal(cell: &str) -> String {
    let lower = cell.trim_start_matches('\u{feff}').to_lowercase();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> anyhow::Result<(Vec<Sample>, Vec<Counter>)> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("imu.csv");
        std::fs::write(&path, text)?;
        let mut csv = Csv::open(&path)?;
        let mut samples = Vec::new();
        while let Some(sample) = csv.next_sample()? {
            samples.push(sample);
        }
        Ok((samples, csv.counters()))
    }

    #[test]
    fn names_and_units_are_found_in_many_spellings() {
        let row = "1700000000123456789,1,2,3,4,5,6\n";
        for header in [
            "stamp_ns,wx,wy,wz,ax,ay,az",
            "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
            "time (ns),gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2",
            "t_ns,rate_rad_s_x,rate_rad_s_y,rate_rad_s_z,acceleration_m_s2_x,acceleration_m_s2_y,acceleration_m_s2_z",
            "\u{feff}t_ns,angular_velocity.x,angular_velocity.y,angular_velocity.z,linear_acceleration.x,linear_acceleration.y,linear_acceleration.z",
        ] {
            let (samples, counters) = read(&format!("{header}\n{row}")).unwrap();
            assert_eq!(samples[0].stamp_ns, 1_700_000_000_123_456_789, "{header}");
            assert_eq!(samples[0].rate_rad_s, Vector3::new(1.0, 2.0, 3.0));
            assert_eq!(samples[0].acceleration_m_s2, Vector3::new(4.0, 5.0, 6.0));
            assert!(counters.is_empty());
        }
    }

    #[test]
    fn units_are_brought_to_si() {
        let (samples, _) = read("time,gx,x,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g\n1700000000.123456789,,,180,0,0,0,0,-1\r\n-1.5,,,0,0,0,0,0,0").unwrap();
        assert_eq!(samples[0].stamp_ns, 1_700_000_000_123_456_789);
        assert!((samples[0].rate_rad_s.x - core::f64::consts::PI).abs() < 1e-12);
        assert_eq!(samples[0].acceleration_m_s2.z, -9.806_65);
        assert_eq!(samples[1].stamp_ns, -1_500_000_000);
    }

    #[test]
    fn a_bad_row_is_counted_with_its_place_and_the_others_are_used() {
        let text =
            "stamp_ns,wx,wy,wz,ax,ay,az\n1,0,0,0,0,0,9\nx,0,0,0,0,0,9\n3,0,0\n\n4,nan,0,0,0,0,9\n";
        let (samples, counters) = read(text).unwrap();
        assert_eq!(samples.len(), 2);
        assert!(samples[1].rate_rad_s.x.is_nan());
        assert_eq!(counters[0].count, 2);
        assert!(
            counters[0]
                .first
                .ends_with("imu.csv: line 3: \"x\" is no time")
        );
    }

    #[test]
    fn what_is_no_table_is_refused_with_a_reason() {
        for (text, reason) in [
            (String::new(), "is empty"),
            ("hello\n".to_owned(), "no column stamp or timestamp"),
            ("t,wx,wy,ax,ay,az\n".to_owned(), "no column w_z or rate_z"),
            ("a".repeat(100_000), "longer than 65536 bytes"),
        ] {
            let error = format!("{:#}", read(&text).unwrap_err());
            assert!(error.contains(reason), "{error}");
        }
    }
}

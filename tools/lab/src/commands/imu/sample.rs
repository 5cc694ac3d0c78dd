//! The samples of an IMU recording, in any of its formats.

use super::table::Table;
use anyhow::Context;
use nalgebra::Vector3;
use randt_readers::{Counter, Event, Options, Source};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// One reading in the IMU's own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Instant of measurement.
    pub stamp_ns: i64,
    /// Angular rate.
    pub rate_rad_s: Vector3<f64>,
    /// Specific force.
    pub acceleration_m_s2: Vector3<f64>,
}

/// A recording that is read from its beginning to its end.
pub enum Samples {
    /// A table.
    Table(Box<Table>),
    /// A bag or one of our logs, with or without a radar.
    Log(Box<dyn Source>),
}

impl Samples {
    /// Opens a recording, recognised by its content.
    pub fn open(path: &Path, topic: Option<String>) -> anyhow::Result<Self> {
        if path.is_dir() || is_log(path)? {
            let options = Options {
                imu_topic: topic,
                radar_required: false,
                ..Options::default()
            };
            Ok(Self::Log(randt_readers::open(path, &options)?))
        } else {
            Ok(Self::Table(Box::new(Table::open(path)?)))
        }
    }

    /// Kind, such as `ros1-bag` or `csv`.
    pub fn format(&self) -> &'static str {
        match self {
            Self::Table(_) => "csv",
            Self::Log(source) => source.info().format,
        }
    }

    /// The next reading, `None` at the end.
    pub fn next_sample(&mut self) -> anyhow::Result<Option<Sample>> {
        let source = match self {
            Self::Table(table) => return table.next_sample(),
            Self::Log(source) => source,
        };
        while let Some(event) = source.next_event()? {
            if let Event::Imu(imu) = event {
                return Ok(Some(Sample {
                    stamp_ns: imu.header.stamp_ns,
                    rate_rad_s: Vector3::from(imu.rate_rad_s),
                    acceleration_m_s2: Vector3::from(imu.acceleration_m_s2),
                }));
            }
        }
        Ok(None)
    }

    /// What was dropped, repaired or assumed so far.
    pub fn counters(&self) -> Vec<Counter> {
        match self {
            Self::Table(table) => table.counters(),
            Self::Log(source) => source.counters(),
        }
    }
}

/// Whether a file begins as a bag or a log does.
fn is_log(path: &Path) -> anyhow::Result<bool> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(16).read_to_end(&mut start))
        .with_context(|| path.display().to_string())?;
    let magics: [&[u8]; 3] = [b"#ROSBAG", b"\x89MCAP0", b"SQLite format 3"];
    Ok(magics.iter().any(|magic| start.starts_with(magic)))
}

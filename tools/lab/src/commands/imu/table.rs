//! An IMU recording as a table: rows of text whose cells stand between commas, semicolons or tabs,
//! quoted or not.
//!
//! Responsible for rows and numbers. Which column holds what is found by `columns`.

use super::columns::{Column, Columns};
use super::sample::Sample;
use anyhow::{Context, anyhow, bail};
use csv::{ByteRecord, Reader, ReaderBuilder, Trim};
use nalgebra::Vector3;
use randt_readers::Counter;
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

/// Longest row. A file without line ends, or a quote that is never closed, must not fill the
/// memory.
const ROW_MAX: u64 = 64 * 1024;
/// The one that the header has most of stands between the cells.
const DELIMITERS: [u8; 3] = *b",;\t";

/// A table that is read row by row.
#[derive(Debug)]
pub struct Table {
    rows: Rows,
    columns: Columns,
    bad_rows: u64,
    first_bad: String,
}

/// The rows of a file, the header included.
#[derive(Debug)]
struct Rows {
    path: String,
    reader: Reader<Bounded>,
    row: ByteRecord,
    /// Semicolons stand between cells where numbers have a decimal comma.
    decimal_comma: bool,
}

/// A file of which only a number of bytes may be read before more are allowed.
#[derive(Debug)]
struct Bounded {
    file: File,
    left: u64,
}

impl Read for Bounded {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        let left = self.left.checked_sub(read as u64);
        self.left = left.ok_or_else(|| {
            let what = "expected a ROS bag or CSV whose quotes are closed";
            io::Error::other(format!("longer than {ROW_MAX} bytes; {what}"))
        })?;
        Ok(read)
    }
}

impl Rows {
    fn open(path: &Path) -> anyhow::Result<Self> {
        let path_text = path.display().to_string();
        let mut file = File::open(path).with_context(|| path_text.clone())?;
        let mut first = Vec::new();
        let read = BufReader::new(&file)
            .take(ROW_MAX)
            .read_until(b'\n', &mut first);
        read.and_then(|_| file.rewind())
            .with_context(|| path_text.clone())?;
        let count = |delimiter: u8| first.iter().filter(|byte| **byte == delimiter).count();
        // Where there are as many of several, the first of these.
        let delimiter = DELIMITERS.into_iter().rev().max_by_key(|it| count(*it));
        let delimiter = delimiter.unwrap_or(b',');
        let reader = ReaderBuilder::new()
            .delimiter(delimiter)
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .from_reader(Bounded { file, left: 0 });
        Ok(Self {
            path: path_text,
            reader,
            row: ByteRecord::new(),
            decimal_comma: delimiter == b';',
        })
    }

    /// Reads the next row that is not blank; false at the end of the file.
    fn advance(&mut self) -> anyhow::Result<bool> {
        loop {
            self.reader.get_mut().left = ROW_MAX;
            let line = self.reader.position().line();
            let read = self.reader.read_byte_record(&mut self.row);
            if !read.with_context(|| format!("{}: line {line}", self.path))? {
                return Ok(false);
            }
            let is_blank = self.row.len() == 1 && self.row.iter().all(<[u8]>::is_empty);
            if !is_blank {
                return Ok(true);
            }
        }
    }

    /// Where the row stands, for texts about it.
    fn location(&self) -> String {
        let line = self.row.position().map_or(0, csv::Position::line);
        format!("{}: line {line}", self.path)
    }

    /// A cell's text. A quote behind a blank is the file's mistake, and no reason to lose the row.
    fn cell(&self, index: usize) -> String {
        let text = String::from_utf8_lossy(self.row.get(index).unwrap_or_default());
        let text = text.trim_matches('"');
        match self.decimal_comma {
            true => text.replace(',', "."),
            false => text.to_owned(),
        }
    }
}

impl Table {
    /// Opens a table and understands its header.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let mut rows = Rows::open(path)?;
        if !rows.advance()? {
            bail!(
                "{}: is empty; expected a ROS bag or a CSV header",
                rows.path
            );
        }
        let header = rows.row.iter().map(String::from_utf8_lossy);
        let header: Vec<String> = header.map(Cow::into_owned).collect();
        let columns =
            Columns::find(&header).map_err(|why| anyhow!("{}: {why}", rows.location()))?;
        Ok(Self {
            rows,
            columns,
            bad_rows: 0,
            first_bad: String::new(),
        })
    }

    /// The next row that holds numbers; others are counted.
    pub fn next_sample(&mut self) -> anyhow::Result<Option<Sample>> {
        while self.rows.advance()? {
            match self.sample() {
                Ok(sample) => return Ok(Some(sample)),
                Err(problem) => {
                    if self.bad_rows == 0 {
                        self.first_bad = format!("{}: {problem}", self.rows.location());
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

    fn sample(&self) -> Result<Sample, String> {
        // A row that lost a cell would give the numbers of another column.
        let (count, expected) = (self.rows.row.len(), self.columns.count);
        if count != expected {
            return Err(format!("{count} columns, expected {expected}"));
        }
        let number = |column: Column| -> Result<f64, String> {
            let text = self.rows.cell(column.index);
            match text.parse::<f64>() {
                Ok(value) => Ok(value * column.scale),
                Err(_) => Err(format!("{:?} is no number", shortened(&text))),
            }
        };
        let vector = |columns: [Column; 3]| -> Result<Vector3<f64>, String> {
            let [x, y, z] = columns;
            Ok(Vector3::new(number(x)?, number(y)?, number(z)?))
        };
        let stamp = self.columns.stamp;
        Ok(Sample {
            stamp_ns: stamp_ns(&self.rows.cell(stamp.index), stamp.scale)?,
            rate_rad_s: vector(self.columns.rate)?,
            acceleration_m_s2: vector(self.columns.acceleration)?,
        })
    }
}

/// The beginning of a text, for messages.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// A stamp without the rounding that a f64 would bring to today's nanoseconds.
fn stamp_ns(text: &str, scale: f64) -> Result<i64, String> {
    let bad = || format!("{:?} is no time", shortened(text));
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> anyhow::Result<(Vec<Sample>, Vec<Counter>)> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("imu.csv");
        std::fs::write(&path, text)?;
        let mut table = Table::open(&path)?;
        let mut samples = Vec::new();
        while let Some(sample) = table.next_sample()? {
            samples.push(sample);
        }
        Ok((samples, table.counters()))
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
    fn quotes_semicolons_tabs_and_byte_order_marks_are_understood() {
        let expected = Sample {
            stamp_ns: 1_500_000_000,
            rate_rad_s: Vector3::new(1.25, 2.0, 3.0),
            acceleration_m_s2: Vector3::new(4.0, 5.0, 6.0),
        };
        for text in [
            // Spreadsheets quote what holds the character that stands between cells, and double a
            // quote inside.
            "\u{feff}\"stamp, s\",\"note \"\"a\"\", b\",wx,wy,wz,ax,ay,az\n\"1.5\",\"stands; \"\"still\"\", then turns\",1.25,2,3,4,5,6\n",
            "stamp [s];wx;wy;wz;\"ax\";ay;az\r\n1.5;1.25;2;3;4;5;6\r\n",
            // Where the decimal sign is a comma.
            "\u{feff}stamp;wx;wy;wz;ax;ay;az;note\n1,5;1,25;2,0;3;4;5;6;x, y\n",
            "stamp\twx\twy\twz\tax\tay\taz\n1.5\t1.25\t2\t3\t4\t5\t6",
            "stamp , wx, wy, wz, ax, ay, az\n 1.5, \"1.25\", 2, 3, 4, 5, 6\n   \n",
        ] {
            let (samples, counters) = read(text).unwrap();
            assert_eq!(samples, [expected], "{text}");
            assert!(counters.is_empty(), "{text}: {counters:?}");
        }
    }

    #[test]
    fn a_quote_that_is_never_closed_does_not_fill_the_memory() {
        let header = "stamp_ns,wx,wy,wz,ax,ay,az\n";
        let row = "1,0,0,0,0,0,9\n";
        let text = format!("{header}{row}\"2,0,0\n{}", row.repeat(10_000));
        let error = format!("{:#}", read(&text).unwrap_err());
        assert!(error.contains("line 3: longer than 65536 bytes"), "{error}");
        // Within the limit it is a row too short, which is counted.
        let (samples, counters) = read(&format!("{header}{row}\"2,0,0\n{row}")).unwrap();
        assert_eq!((samples.len(), counters[0].count), (1, 1));
        assert!(
            counters[0].first.contains("line 3: 1 columns"),
            "{counters:?}"
        );
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

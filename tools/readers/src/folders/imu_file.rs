//! The IMU files of data sets: Boreas' and MulRan's tables, RADIATE's file for each sample.

use super::layout::{DataSet, stamp_ns};
use crate::counters::Counters;
use crate::limit::{is_instant, is_misread};
use randt_messages::{Header, ImuSample};
use std::path::Path;

/// Longest plausible table: a day at 400 Hz of 300 bytes a line is 10 GB, an hour 0.4.
const BYTES_MAX: u64 = 2 << 30;

/// Reads all samples, in order of time. What is no sample is counted.
pub(super) fn read(
    path: &Path,
    data_set: DataSet,
    counters: &mut Counters,
) -> Result<Vec<ImuSample>, std::io::Error> {
    let rows = match data_set {
        DataSet::Radiate => radiate_rows(path)?,
        _ => table_rows(path, data_set)?,
    };
    let shown = path.display();
    let mut samples = Vec::new();
    for row in rows {
        let (stamp_ns, rate, acceleration) = match row {
            Ok(sample) => sample,
            Err(why) => {
                counters.count_loss("imu_samples_malformed", 1, || format!("{shown}: {why}"));
                continue;
            }
        };
        if !is_misread(counters, stamp_ns, &rate, &acceleration) {
            samples.push(ImuSample {
                header: Header {
                    stamp_ns,
                    ..Header::default()
                },
                device_ns: stamp_ns,
                arrival_ns: stamp_ns,
                rate_rad_s: rate,
                acceleration_m_s2: acceleration,
            });
        }
    }
    samples.sort_by_key(|sample| sample.header.stamp_ns);
    samples.dedup_by_key(|sample| sample.header.stamp_ns);
    for (sequence, sample) in (0..).zip(&mut samples) {
        sample.header.sequence = sequence;
    }
    Ok(samples)
}

/// Stamp, rate, acceleration; or why a row is none.
type Row = Result<(i64, [f64; 3], [f64; 3]), String>;

fn text(path: &Path) -> Result<String, std::io::Error> {
    let length = std::fs::metadata(path)?.len();
    if length > BYTES_MAX {
        return Err(std::io::Error::other(format!(
            "{length} bytes; an IMU's table has up to {BYTES_MAX}"
        )));
    }
    Ok(String::from_utf8_lossy(&std::fs::read(path)?).into_owned())
}

/// Rows of numbers between commas.
fn table_rows(path: &Path, data_set: DataSet) -> Result<Vec<Row>, std::io::Error> {
    let text = text(path)?;
    // As the header names them; without one Boreas': time, rates about z, y, x, accelerations
    // along z, y, x. MulRan's: time, quaternion, three angles, rates, accelerations, field.
    let columns = match data_set {
        DataSet::MulRan => [8, 9, 10, 11, 12, 13],
        _ => named_columns(&text).unwrap_or([3, 2, 1, 6, 5, 4]),
    };
    let mut rows = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let cells: Vec<&str> = line
            .split([',', ' ', '\t'])
            .filter(|c| !c.is_empty())
            .collect();
        let is_header = number == 1 && cells.first().is_some_and(|c| stamp_ns(c).is_none());
        if cells.is_empty() || is_header {
            continue;
        }
        rows.push(row(&cells, columns).ok_or_else(|| {
            let most = columns.into_iter().max().unwrap_or_default() + 1;
            format!("line {number}: expected a stamp and numbers in {most} columns")
        }));
    }
    Ok(rows)
}

/// The columns of rates and accelerations by the header; `None` where it does not name all.
fn named_columns(text: &str) -> Option<[usize; 6]> {
    let header = text.lines().next()?.to_lowercase();
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let column = |words: [&str; 2], axis: char| {
        let is_named = |name: &&str| words.iter().any(|word| **name == format!("{word}{axis}"));
        names.iter().position(is_named)
    };
    let mut columns = [0; 6];
    for (index, axis) in "xyz".chars().enumerate() {
        *columns.get_mut(index)? = column(["angvel_", "w"], axis)?;
        *columns.get_mut(index + 3)? = column(["accel", "a"], axis)?;
    }
    Some(columns)
}

fn row(cells: &[&str], columns: [usize; 6]) -> Option<(i64, [f64; 3], [f64; 3])> {
    let stamp_ns = stamp_ns(cells.first()?).filter(|stamp_ns| is_instant(*stamp_ns))?;
    let mut values = [0.0; 6];
    for (value, column) in values.iter_mut().zip(columns) {
        *value = cells.get(column)?.parse().ok()?;
    }
    let [x, y, z, ax, ay, az] = values;
    Some((stamp_ns, [x, y, z], [ax, ay, az]))
}

/// The files that the list beside their folder names, with their stamps: in each the rates in the
/// sixth line, the accelerations in the seventh.
fn radiate_rows(folder: &Path) -> Result<Vec<Row>, std::io::Error> {
    let list = text(&folder.with_extension("txt"))?;
    let rows = frames(&list).map(|(name, stamp_ns)| {
        let path = folder.join(format!("{name}.txt"));
        let text = text(&path).map_err(|error| format!("{name}.txt: {error}"))?;
        let mut lines = text.lines().skip(5).map(|line| {
            let cells = line.split([',', ' ', '\t']).filter(|c| !c.is_empty());
            let numbers: Vec<f64> = cells.filter_map(|cell| cell.parse().ok()).collect();
            numbers.first_chunk::<3>().copied()
        });
        match (lines.next().flatten(), lines.next().flatten()) {
            (Some(rate), Some(acceleration)) => Ok((stamp_ns, rate, acceleration)),
            _ => Err(format!(
                "{name}.txt: expected three rates in line 6 and accelerations in line 7"
            )),
        }
    });
    Ok(rows.collect())
}

/// The lines `Frame: 000001 Time: 1574859771.744660272` of a list.
pub(super) fn frames(list: &str) -> impl Iterator<Item = (&str, i64)> {
    list.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        let name = words
            .by_ref()
            .find(|word| word.bytes().all(|b| b.is_ascii_digit()))?;
        let stamp_ns = words
            .find_map(stamp_ns)
            .filter(|stamp_ns| is_instant(*stamp_ns))?;
        Some((name, stamp_ns))
    })
}

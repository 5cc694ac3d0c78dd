//! The bench's file: each finished drive is a line, so that a bench that was ended goes on, and a
//! table that was accepted is one to compare with.

use super::figures::{COLUMNS, Figures};
use super::plan::Trial;
use anyhow::{Context, ensure};
use clap::ValueEnum;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// Heads of what names a drive, before the figures.
const KEYS: [&str; 8] = [
    "binary_sha256",
    "randt",
    "settings",
    "world",
    "world_sha256",
    "fault",
    "seed",
    "scans",
];

/// Which program computes, and how: drives of another one are computed anew.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Build {
    /// First digits of the hash of its file.
    pub binary_sha256: String,
    /// Version and commit.
    pub randt: String,
    /// Profile and what else was chosen.
    pub settings: String,
}

/// A drive with what it gave.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cell {
    /// What computed it.
    pub build: Build,
    /// The drive.
    pub trial: Trial,
    /// What it gave.
    pub figures: Figures,
}

/// Reads all drives of a file; those of faults that this program does not know, and a last line
/// that was cut, are left out.
pub(super) fn read(path: &Path) -> anyhow::Result<Vec<Cell>> {
    let name = || path.display().to_string();
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_path(path)
        .with_context(name)?;
    let heads = reader.headers().with_context(name)?.clone();
    for key in KEYS {
        let message = || format!("{}: no table of this bench: no column {key}", name());
        ensure!(heads.iter().any(|head| head == key), message());
    }
    let mut cells = Vec::new();
    for record in reader.records() {
        let record = record.with_context(name)?;
        if record.len() == heads.len() {
            cells.extend(cell(&heads, &record));
        }
    }
    Ok(cells)
}

fn cell(heads: &csv::StringRecord, record: &csv::StringRecord) -> Option<Cell> {
    let text = |name: &str| {
        let index = heads.iter().position(|head| head == name)?;
        record.get(index)
    };
    let owned = |name: &str| text(name).map(str::to_owned);
    let mut figures = Figures::default();
    for column in COLUMNS {
        let value = text(column.name).and_then(|value| value.parse().ok());
        figures.set(column.name, value);
    }
    Some(Cell {
        build: Build {
            binary_sha256: owned("binary_sha256")?,
            randt: owned("randt")?,
            settings: owned("settings")?,
        },
        trial: Trial {
            world: owned("world")?,
            world_sha256: owned("world_sha256")?,
            fault: ValueEnum::from_str(text("fault")?, false).ok()?,
            seed: text("seed")?.parse().ok()?,
            scans: text("scans")?.parse().ok()?,
        },
        figures,
    })
}

/// The file, to be written on.
pub(super) struct Record {
    file: File,
}

impl Record {
    /// Opens a file with the drives that it has; a new one where there is none.
    pub fn open(path: &Path) -> anyhow::Result<(Self, Vec<Cell>)> {
        let name = || path.display().to_string();
        let old = fs::read_to_string(path).unwrap_or_default();
        let heads = heads();
        let cells = match old.lines().next() {
            None => Vec::new(),
            Some(first) => {
                let message = || {
                    let name = name();
                    format!("{name}: a table with other columns; --out names another file")
                };
                ensure!(first == heads, message());
                read(path)?
            }
        };
        let mut file = File::options()
            .append(true)
            .create(true)
            .open(path)
            .with_context(name)?;
        if old.is_empty() {
            writeln!(file, "{heads}").with_context(name)?;
        } else if !old.ends_with('\n') {
            // What was cut stays a line of its own.
            writeln!(file).with_context(name)?;
        }
        Ok((Self { file }, cells))
    }

    /// Adds a drive, as one write.
    pub fn add(&mut self, cell: &Cell) -> anyhow::Result<()> {
        let mut line = csv::Writer::from_writer(Vec::new());
        line.write_record(fields(cell))?;
        let line = line.into_inner().map_err(|error| error.into_error())?;
        Ok(self.file.write_all(&line)?)
    }
}

fn heads() -> String {
    let columns = COLUMNS.iter().map(|column| column.name);
    KEYS.into_iter()
        .chain(columns)
        .collect::<Vec<_>>()
        .join(",")
}

fn fields(cell: &Cell) -> Vec<String> {
    let (build, trial) = (&cell.build, &cell.trial);
    let mut fields = vec![
        build.binary_sha256.clone(),
        build.randt.clone(),
        build.settings.clone(),
        trial.world.clone(),
        trial.world_sha256.clone(),
        trial.fault.to_string(),
        trial.seed.to_string(),
        trial.scans.to_string(),
    ];
    fields.extend(COLUMNS.iter().map(|column| {
        let value = cell.figures.get(column.name);
        value.map_or(String::new(), |value| {
            format!("{value:.*}", column.decimals)
        })
    }));
    fields
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::Fault;

    fn cell(seed: u64) -> Cell {
        Cell {
            build: Build {
                binary_sha256: "0123456789abcdef".to_owned(),
                randt: "0.1.0 (abc)".to_owned(),
                settings: "profile mixed, ndt.slack=5".to_owned(),
            },
            trial: Trial {
                world: "yard".to_owned(),
                world_sha256: "01234567".to_owned(),
                fault: Fault::Frozen10,
                seed,
                scans: 800,
            },
            figures: Figures {
                silent_m: Some(3.0),
                good: Some(0.875),
                ..Figures::default()
            },
        }
    }

    #[test]
    fn what_was_written_is_read_and_a_cut_line_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trust.csv");
        let (mut record, none) = Record::open(&path).unwrap();
        assert!(none.is_empty());
        record.add(&cell(1)).unwrap();
        record.add(&cell(2)).unwrap();
        let whole = fs::read(&path).unwrap();
        assert_eq!(read(&path).unwrap(), [cell(1), cell(2)]);

        fs::write(&path, &whole[..whole.len() - 9]).unwrap();
        let (mut record, rest) = Record::open(&path).unwrap();
        assert_eq!(rest, [cell(1)]);
        record.add(&cell(3)).unwrap();
        assert_eq!(read(&path).unwrap(), [cell(1), cell(3)]);
    }

    #[test]
    fn a_table_of_something_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other.csv");
        fs::write(&path, "seed,world\n1,yard\n").unwrap();
        assert!(Record::open(&path).is_err());
        let text = read(&path).unwrap_err().to_string();
        assert!(text.contains("no column binary_sha256"), "{text}");
    }
}

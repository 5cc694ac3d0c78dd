//! The tables of stages and topics, as words.

use super::snapshot::Snapshot;
use crate::units::{bytes, or_dash, seconds};

/// A table: its first column and those that are words stand to the left, numbers to the right.
pub struct Table {
    /// Heads of the columns.
    pub heads: &'static [&'static str],
    /// Which columns are words.
    pub words: &'static [usize],
    /// The cells.
    pub rows: Vec<Vec<String>>,
}

/// The stages.
pub fn stages(snapshot: &Snapshot) -> Table {
    let rows = snapshot.stages.iter().map(|stage| {
        vec![
            stage.name.clone(),
            stage.pid.to_string(),
            stage.state.to_owned(),
            stage.restarts.to_string(),
            or_dash(stage.cpu_percent, |percent| format!("{percent:.1} %")),
            or_dash(stage.rss_bytes, bytes),
            stage.lost.to_string(),
        ]
    });
    Table {
        heads: &["STAGE", "PID", "STATE", "RESTARTS", "CPU", "MEMORY", "LOST"],
        words: &[0, 2],
        rows: rows.collect(),
    }
}

/// The topics.
pub fn topics(snapshot: &Snapshot) -> Table {
    let rows = snapshot.topics.iter().map(|topic| {
        vec![
            topic.name.clone(),
            format!("{:.1} Hz", topic.rate_hz),
            or_dash(topic.age_s, seconds),
            topic.lost.to_string(),
        ]
    });
    Table {
        heads: &["TOPIC", "RATE", "AGE", "LOST"],
        words: &[0],
        rows: rows.collect(),
    }
}

impl Table {
    /// The width of each column.
    pub fn widths(&self) -> Vec<usize> {
        let widest = |(i, head): (usize, &&str)| {
            let cells = self.rows.iter().filter_map(|row| row.get(i));
            let lengths = cells.map(|cell| cell.chars().count());
            lengths.fold(head.len(), usize::max)
        };
        self.heads.iter().enumerate().map(widest).collect()
    }

    /// A cell of a column, filled up to its width on the side that it stands on.
    pub fn filled(&self, column: usize, cell: &str, width: usize) -> String {
        if self.words.contains(&column) {
            format!("{cell:<width$}")
        } else {
            format!("{cell:>width$}")
        }
    }
}

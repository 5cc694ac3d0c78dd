//! A snapshot as plain text.

use super::facts::{self, Fact};
use super::snapshot::Snapshot;
use super::table::{self, Table};

/// Everything, one part below the other.
pub fn plain(snapshot: &Snapshot) -> String {
    let mut parts = vec![
        format!("domain {} in {}\n", snapshot.prefix, snapshot.run),
        rows(&table::stages(snapshot)),
        rows(&table::topics(snapshot)),
        lines(&[facts::robot(snapshot), facts::map(snapshot)].concat()),
    ];
    let notes = snapshot.notes.iter();
    parts.push(notes.map(|note| format!("{note}\n")).collect());
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// A table; nothing where it is empty.
fn rows(table: &Table) -> String {
    if table.rows.is_empty() {
        return String::new();
    }
    let widths = table.widths();
    let line = |cells: Vec<&str>| {
        let filled = cells.iter().zip(&widths).enumerate();
        let cells: Vec<String> = filled
            .map(|(i, (cell, width))| table.filled(i, cell, *width))
            .collect();
        format!("{}\n", cells.join("  ").trim_end())
    };
    let heads = line(table.heads.to_vec());
    let rows = table.rows.iter();
    let rows = rows.map(|row| line(row.iter().map(String::as_str).collect()));
    [heads].into_iter().chain(rows).collect()
}

fn lines(facts: &[Fact]) -> String {
    let line = |(name, value): &Fact| format!("{name:<10} {value}\n");
    facts.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_left_and_numbers_right() {
        let table = Table {
            heads: &["TOPIC", "RATE"],
            words: &[0],
            rows: vec![
                vec!["imu".to_owned(), "250.0 Hz".to_owned()],
                vec!["radar/scan".to_owned(), "5.0 Hz".to_owned()],
            ],
        };
        let expected = "TOPIC           RATE\nimu         250.0 Hz\nradar/scan    5.0 Hz\n";
        assert_eq!(rows(&table), expected);
    }
}

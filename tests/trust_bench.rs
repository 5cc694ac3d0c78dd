//! `randt-lab bench trust` as a user calls it, in its short form.

use crate::support::{Ended, ended, lab};
use std::fs;
use std::path::Path;

fn bench(table: &Path, more: &[&str]) -> Ended {
    let mut command = lab(&["bench", "trust", "--quick", "--out"]);
    command.arg(table).args(more);
    ended(command)
}

#[test]
fn drives_are_lines_that_are_computed_once_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let [table, old] = ["trust.csv", "old.csv"].map(|name| folder.path().join(name));
    let first = bench(&table, &[]);
    println!("{}", first.stdout);
    // The corridor is believed where it is wrong.
    assert!(matches!(first.code, Some(0 | 3)), "{}", first.stderr);
    assert!(first.stdout.lines().all(|line| line.chars().count() < 100));
    let text = fs::read_to_string(&table).unwrap();
    // Drives are computed side by side; the one that ends first is the first line.
    let heads = text.lines().next().unwrap();
    let row_of = |world: &str| text.lines().find(|row| row.contains(world)).unwrap();
    let [building, corridor] = [",building,", ",corridor,"].map(row_of);
    assert_eq!(text.lines().count(), 3, "{text}");
    let figure = |row: &str, name: &str| -> f64 {
        let column = heads.split(',').position(|head| head == name).unwrap();
        row.rsplit(',')
            .nth(heads.split(',').count() - 1 - column)
            .unwrap()
            .parse()
            .unwrap()
    };
    let good = [building, corridor].map(|row| figure(row, "good"));
    assert!(good[0] > 0.98 && good[1] < good[0], "{good:?}");
    assert_eq!(figure(building, "silent_m"), 0.0);
    assert_eq!(figure(corridor, "stretches"), 1.0);

    // The second time it only reads, and is as good as itself.
    fs::copy(&table, &old).unwrap();
    let again = bench(&table, &["--against", old.to_str().unwrap()]);
    assert_eq!(fs::read_to_string(&table).unwrap(), text);
    assert!(again.stdout.starts_with(first.stdout.trim_end()));
    assert!(
        again.stdout.contains("by more than the spread: 0"),
        "{}",
        again.stdout
    );
    assert_eq!(again.code, first.code);

    // Better than it can be: the building was good everywhere.
    let share = format!(",{:.4},", good[0]);
    fs::write(&old, text.replace(&share, ",1.1000,")).unwrap();
    let worse = bench(&table, &["--against", old.to_str().unwrap()]);
    assert!(
        worse.stdout.contains("building, none: good "),
        "{}",
        worse.stdout
    );
    assert_eq!(worse.code, Some(3));
}

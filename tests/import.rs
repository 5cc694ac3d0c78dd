//! `randt import` as a user calls it.

use crate::support::recordings::recording;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn import(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_randt"))
        .arg("import")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> &str {
    str::from_utf8(&output.stdout).unwrap()
}

fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

#[test]
fn a_bag_becomes_a_log_that_imports_to_the_same_bytes() {
    let Some(bag) = recording("bags/room.bag") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let bag = bag.display().to_string();
    let output = import(folder.path(), &[&bag, "a.mcap"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).starts_with("a.mcap: 200 sweeps, 10000 IMU samples, 0 true poses"));
    let output = import(folder.path(), &["a.mcap", "b.mcap"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(read("a.mcap") == read("b.mcap"));

    // It overwrites only on request.
    let output = import(folder.path(), &[&bag, "a.mcap"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("a.mcap: exists already; --force"),
        "{}",
        stderr(&output)
    );
    let output = import(
        folder.path(),
        &[&bag, "b.mcap", "--force", "--period", "0.25"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(read("a.mcap") != read("b.mcap"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_cut_bag_becomes_a_log_of_what_is_there_and_names_what_is_not() {
    let Some(bag) = recording("bags/room.bag") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let whole = fs::read(bag).unwrap();
    fs::write(folder.path().join("cut.bag"), &whole[..10_000_000]).unwrap();
    let output = import(folder.path(), &["cut.bag", "cut.mcap"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.starts_with("cut.mcap: 66 sweeps"), "{text}");
    assert!(
        text.contains("lost 1 bag_damaged: cut.bag: at byte 9879225: "),
        "{text}"
    );
}

#[test]
fn what_is_no_recording_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("note.txt"), "a shopping list").unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    for (input, words) in [
        (
            "note.txt",
            "note.txt: begins with a shopping list; expected a folder of polar images",
        ),
        (
            "empty",
            "empty: a folder without radar images or bag files; expected",
        ),
        ("absent.bag", "absent.bag: No such file"),
    ] {
        let output = import(folder.path(), &[input, "log.mcap"]);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
    let output = import(folder.path(), &["note.txt", "log.mcap", "--period", "-1"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

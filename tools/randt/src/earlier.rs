//! A folder that holds an earlier drive: its files are kept, in a numbered folder beside the new
//! ones.

use crate::output::warn;
use anyhow::{Context, ensure};
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What every drive leaves in its folder.
const RESULTS: [&str; 9] = [
    "keyframes.tum",
    "map.pgm",
    "map.png",
    "map.yaml",
    "odometry.csv",
    "odometry.tum",
    "plot.svg",
    "report.json",
    "trajectory.tum",
];
/// The mapper's journal in the folder of a live drive, and the ones that it quarantines stand
/// beside it.
pub const JOURNAL: &str = "map.journal";
/// Numbered from 1 on.
const BEFORE: &str = "before-";

/// Moves the results of an earlier drive, if a folder holds any, to `before-N` in it, with a
/// warning.
pub fn keep_results(out: &Path) -> anyhow::Result<()> {
    keep(out, |name| RESULTS.contains(&name))
}

/// The same with the map's journal, for a drive that begins one.
pub fn keep_drive(out: &Path) -> anyhow::Result<()> {
    let lock = out.join(format!("{JOURNAL}.lock"));
    let lock = File::open(lock).map(|lock| lock.try_lock());
    ensure!(
        !matches!(lock, Ok(Err(TryLockError::WouldBlock))),
        "{}: another pipeline writes its files here; give this one another --out",
        out.display()
    );
    keep(out, |name| {
        name == JOURNAL || is_quarantined_journal(name) || RESULTS.contains(&name)
    })
}

/// Whether a file is a journal that a mapper has quarantined.
pub fn is_quarantined_journal(name: &str) -> bool {
    // As builds up to 30a8848 named it.
    let former = ".aside";
    let suffix = name.strip_prefix(JOURNAL).unwrap_or_default();
    suffix.starts_with(".quarantined") || suffix.starts_with(former)
}

fn keep(out: &Path, is_of_a_drive: impl Fn(&str) -> bool) -> anyhow::Result<()> {
    let found = match fs::read_dir(out) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        found => found.with_context(|| out.display().to_string())?,
    };
    let files = found.flatten().filter(|entry| !entry.path().is_dir());
    let mut names: Vec<_> = files.map(|entry| entry.file_name()).collect();
    names.retain(|name| name.to_str().is_some_and(&is_of_a_drive));
    names.sort();
    if names.is_empty() {
        return Ok(());
    }
    let before = first_free(out)?;
    for name in names {
        let (from, to) = (out.join(&name), before.join(&name));
        let context = || format!("{}: cannot be moved to {}", from.display(), to.display());
        fs::rename(&from, &to).with_context(context)?;
    }
    let (out, before) = (out.display(), before.display());
    warn(&format!(
        "{out}: holds an earlier drive; it is kept in {before}"
    ));
    Ok(())
}

/// Makes the first `before-N` that is not there yet.
fn first_free(out: &Path) -> anyhow::Result<PathBuf> {
    let mut number = 1_u64;
    loop {
        let before = out.join(format!("{BEFORE}{number}"));
        match fs::create_dir(&before) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            made => {
                made.with_context(|| format!("{}: cannot be made", before.display()))?;
                return Ok(before);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarantined_journals_of_every_build_are_known() {
        let former = "map.journal.aside-2";
        assert!(is_quarantined_journal(former));
        assert!(is_quarantined_journal("map.journal.quarantined-1"));
        for other in [JOURNAL, "map.journal.lock", "map.yaml"] {
            assert!(!is_quarantined_journal(other), "{other}");
        }
    }

    #[test]
    fn every_earlier_drive_is_kept_whole_under_a_number_of_its_own() {
        let out = tempfile::tempdir().unwrap();
        let write = |text: &str| {
            for name in [
                "map.pgm",
                "trajectory.tum",
                JOURNAL,
                "map.journal.quarantined-1",
            ] {
                fs::write(out.path().join(name), text).unwrap();
            }
        };
        fs::write(out.path().join("notes.txt"), "mine").unwrap();
        for text in ["one", "two", "three"] {
            write(text);
            keep_drive(out.path()).unwrap();
        }
        for (number, text) in ["one", "two", "three"].into_iter().enumerate() {
            let before = out.path().join(format!("before-{}", number + 1));
            for name in [
                "map.pgm",
                "trajectory.tum",
                JOURNAL,
                "map.journal.quarantined-1",
            ] {
                assert_eq!(fs::read_to_string(before.join(name)).unwrap(), text);
            }
        }
        let left = out.path().join("notes.txt");
        assert_eq!(fs::read_to_string(left).unwrap(), "mine");
        assert!(!out.path().join("map.pgm").exists());
    }

    #[test]
    fn a_computation_leaves_a_journal_where_it_is() {
        let out = tempfile::tempdir().unwrap();
        keep_results(&out.path().join("not-there")).unwrap();
        fs::write(out.path().join(JOURNAL), "keyframes").unwrap();
        keep_results(out.path()).unwrap();
        assert!(out.path().join(JOURNAL).is_file());
        assert!(!out.path().join("before-1").exists());
    }

    #[test]
    fn a_folder_that_a_mapper_writes_into_is_refused() {
        let out = tempfile::tempdir().unwrap();
        let lock = File::create(out.path().join("map.journal.lock")).unwrap();
        lock.lock().unwrap();
        let text = keep_drive(out.path()).unwrap_err().to_string();
        assert!(text.contains("another pipeline writes"), "{text}");
    }
}

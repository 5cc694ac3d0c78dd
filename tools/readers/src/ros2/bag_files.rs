//! The files of a bag's folder.

use crate::Error;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The files of a bag's folder in the order of their numbers; rosbag2 names them `NAME_0`,
/// `NAME_1`, ..., with a `.zstd` behind it where it has compressed them.
pub(crate) fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let plain = without_compression(&path);
        let extension = plain.extension().and_then(OsStr::to_str);
        if path.is_file() && matches!(extension, Some("db3" | "mcap" | "bag")) {
            files.push(path);
        }
    }
    files.sort_by_key(|path| (number(path), path.clone()));
    Ok(files)
}

/// A file's name without the ending of its compression.
fn without_compression(path: &Path) -> PathBuf {
    match path.extension().and_then(OsStr::to_str) {
        Some("zstd" | "zst") => path.with_extension(""),
        _ => path.to_owned(),
    }
}

/// The number at the end of a file's name.
fn number(path: &Path) -> Option<u64> {
    let plain = without_compression(path);
    let stem = plain.file_stem().and_then(OsStr::to_str)?;
    stem.rsplit('_').next()?.parse().ok()
}

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

/// Largest plausible metadata.yaml: a day in files of a minute names 1,440.
const METADATA_MAX: u64 = 16 << 20;

/// The files that the folder's metadata.yaml names and that are not there, in words.
pub(crate) fn missing_files(folder: &Path) -> Vec<String> {
    let path = folder.join("metadata.yaml");
    let is_short = std::fs::metadata(&path).is_ok_and(|file| file.len() <= METADATA_MAX);
    let text = is_short.then(|| std::fs::read(&path).ok()).flatten();
    let text = String::from_utf8_lossy(text.as_deref().unwrap_or_default()).into_owned();
    let lines = text.lines().map(str::trim);
    let listed = lines
        .skip_while(|line| *line != "relative_file_paths:")
        .skip(1)
        .map_while(|line| line.strip_prefix("- "));
    let names = listed.map(|name| name.trim_matches(['"', '\'']));
    let is_there = |name: &str| {
        // Older recorders name the folder too, and some leave out what they add for compression.
        let name = Path::new(name).file_name().unwrap_or_default();
        let plain = folder.join(name);
        let mut packed = plain.clone().into_os_string();
        packed.push(".zstd");
        plain.exists() || without_compression(&plain).exists() || Path::new(&packed).exists()
    };
    let missing = names.filter(|name| !is_there(name));
    missing
        .map(|name| format!("{} names {name}, which is not there", path.display()))
        .collect()
}

//! SHA-256 of inputs and outputs, so that a result can be tied to its data.

use anyhow::Context;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Bytes read at once: large enough to keep the disk busy, small enough for the cache.
const BLOCK: usize = 1 << 18;

/// Hash of a text.
pub fn of_bytes(bytes: &[u8]) -> String {
    hex(Sha256::new().chain_update(bytes))
}

/// Hash of a file; of a folder, of the files below it in order of their names.
pub fn of_path(path: &Path) -> anyhow::Result<String> {
    let mut hasher = Sha256::new();
    for file in files(path)? {
        let context = || file.display().to_string();
        let file = File::open(&file).with_context(context)?;
        let mut reader = BufReader::with_capacity(BLOCK, file);
        while let block @ [_, ..] = reader.fill_buf().with_context(context)? {
            hasher.update(block);
            let count = block.len();
            reader.consume(count);
        }
    }
    Ok(hex(hasher))
}

fn hex(hasher: Sha256) -> String {
    let bytes = hasher.finalize();
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn files(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    for entry in fs::read_dir(path).with_context(|| path.display().to_string())? {
        let below = entry.with_context(|| path.display().to_string())?.path();
        found.extend(files(&below)?);
    }
    found.sort();
    Ok(found)
}

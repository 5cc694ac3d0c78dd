//! Messages and files that rosbag2 has compressed: a zstd frame in place of each.

use std::borrow::Cow;
use std::io::{Read, Write};
use std::path::Path;
use tempfile::TempPath;

/// First bytes of a zstd frame. No CDR message begins with them, since its first byte is 0.
pub(crate) const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Largest plausible message; it bounds what a hostile frame can make us allocate.
const MESSAGE_MAX: u64 = 256 << 20;

/// Largest plausible size of a file over that of its frame: an empty image shrinks to a
/// thousandth.
const RATIO_MAX: u64 = 5000;

/// A message as it was published.
pub(crate) fn unpack(bytes: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    if !bytes.starts_with(&MAGIC) {
        return Ok(Cow::Borrowed(bytes));
    }
    let text = |error: std::io::Error| format!("zstd: {error}");
    let decoder = zstd::Decoder::with_buffer(bytes).map_err(text)?;
    let mut message = Vec::new();
    let mut limited = decoder.take(MESSAGE_MAX);
    limited.read_to_end(&mut message).map_err(text)?;
    Ok(Cow::Owned(message))
}

/// A compressed file, decompressed into the system's temporary folder; it goes away with the value.
pub(crate) fn unpack_file(path: &Path) -> std::io::Result<TempPath> {
    let packed = std::fs::File::open(path)?;
    let most = packed.metadata()?.len().saturating_mul(RATIO_MAX);
    let mut file = tempfile::NamedTempFile::new()?;
    let mut decoder = zstd::Decoder::new(packed)?.take(most);
    let mut buffer = vec![0; 1 << 16];
    loop {
        // A frame that is cut gives what is there; the recording's reader meets its end.
        let read = decoder.read(&mut buffer).unwrap_or(0);
        if read == 0 {
            break;
        }
        file.write_all(buffer.get(..read).unwrap_or_default())?;
    }
    Ok(file.into_temp_path())
}

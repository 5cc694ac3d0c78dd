//! Plain files of folders that somebody else may write to: no link is followed, no pipe is waited
//! for.

use anyhow::ensure;
use rustix::fs::OFlags;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// No text of ours is longer, by far. A file may claim the length of a disk.
const TEXT_MAX: u64 = 16 << 20;

/// Opens a plain file for reading.
pub fn open(path: &Path) -> anyhow::Result<File> {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY;
    let mut options = File::options();
    let file = options.read(true).custom_flags(flags.bits().cast_signed());
    let file = file.open(path)?;
    ensure!(
        file.metadata()?.is_file(),
        "{}: is no plain file",
        path.display()
    );
    Ok(file)
}

/// Reads one of any length.
pub fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a text.
pub fn read_to_string(path: &Path) -> anyhow::Result<String> {
    let mut file = open(path)?;
    let mut text = String::new();
    let length = file.by_ref().take(TEXT_MAX).read_to_string(&mut text)?;
    ensure!(
        (length as u64) < TEXT_MAX,
        "{}: is longer than {TEXT_MAX} bytes",
        path.display()
    );
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn what_is_no_plain_file_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("plain"), "text").unwrap();
        assert_eq!(read_to_string(&path("plain")).unwrap(), "text");
        symlink("plain", path("link")).unwrap();
        mknodat(
            CWD,
            path("pipe"),
            FileType::Fifo,
            Mode::from_raw_mode(0o600),
            0,
        )
        .unwrap();
        for name in ["link", "pipe", "absent", "/dev/zero", "."] {
            assert!(read_to_string(&path(name)).is_err(), "{name}");
        }
        let large = File::create(path("large")).unwrap();
        large.set_len(1 << 40).unwrap();
        let error = read_to_string(&path("large")).unwrap_err().to_string();
        assert!(error.contains("is longer than"), "{error}");
    }
}

//! What a command leaves behind: files that are whole or absent, text on standard output.

use anyhow::Context;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Refuses a file that exists unless it may be replaced, and anything that is no plain file whatever may be.
pub fn may_write(path: &Path, force: bool) -> anyhow::Result<()> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() => anyhow::bail!("{}: is not a plain file", path.display()),
        Ok(_) if !force => {
            anyhow::bail!("{}: exists already; --force overwrites it", path.display())
        }
        _ => Ok(()),
    }
}

/// Writes a file whole or not at all: under a temporary name in the same folder, then renamed.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let temporary = temporary_name(path);
    let written = File::create(&temporary)
        .and_then(|mut file| {
            file.write_all(bytes)?;
            // A name must not become durable before its content.
            file.sync_all()
        })
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // Best effort: the first error is what the user needs to see.
        let _ = fs::remove_file(&temporary);
    }
    written.with_context(|| format!("{}: cannot be written", path.display()))
}

/// The same name with `.part` behind it, so that nobody takes it for the finished file.
fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no failure, nor is a terminal that was closed.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe || is_hung_up(&error) => Ok(()),
        result => result.context("standard output"),
    }
}

/// Writes a line to standard error. Where nobody can read it any more the work goes on: `eprintln!` would panic.
pub fn warn(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Whether a terminal was closed: the system calls that an input/output error.
fn is_hung_up(error: &io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_or_left_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        write_whole(&path, b"one").unwrap();
        write_whole(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");

        let absent = folder.path().join("no-such-folder").join("report.json");
        let text = format!("{:#}", write_whole(&absent, b"three").unwrap_err());
        assert!(text.contains("report.json: cannot be written"), "{text}");

        // The final name is taken by a folder: nothing is left lying about.
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(write_whole(&taken, b"four").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}

//! What a command leaves behind: files that are whole or absent, text on standard output.

use anyhow::{Context, bail};
use randt_log::{LogFile, Options};
use randt_messages::{MessageRef, Topic};
use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// Who may read and write a file: everybody as far as the umask lets them, or its owner.
const FOR_ALL: u32 = 0o666;
const PRIVATE: u32 = 0o600;

/// Refuses a file that exists unless it may be replaced, and always anything that is no plain
/// file.
pub fn may_write(path: &Path, force: bool) -> anyhow::Result<()> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() => bail!("{}: is not a plain file", path.display()),
        Ok(_) if !force => bail!("{}: exists already; --force overwrites it", path.display()),
        _ => Ok(()),
    }
}

/// Makes a folder and tries it out, before the work begins.
pub fn prepare_folder(folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let probe = folder.join(".randt-probe");
    write_whole(&probe, b"")?;
    fs::remove_file(&probe).with_context(|| probe.display().to_string())
}

/// Writes a file whole or not at all: under a temporary name in the same folder, then renamed.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_with_mode(path, bytes, FOR_ALL)
}

/// The same of a file that is this user's alone.
pub fn write_private(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_with_mode(path, bytes, PRIVATE)
}

fn write_with_mode(path: &Path, bytes: &[u8], mode: u32) -> anyhow::Result<()> {
    let temporary = temporary_name(path);
    // What a kill left there, or somebody else put there: nothing is written through a link.
    let _ = fs::remove_file(&temporary);
    let mut options = File::options();
    let options = options.write(true).create_new(true).mode(mode);
    let written = options
        .open(&temporary)
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
pub fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no failure, nor is a
/// terminal that was closed.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe || is_hung_up(&error) => Ok(()),
        result => result.context("standard output"),
    }
}

/// Options of a log that this program writes.
pub fn log_options() -> Options {
    Options {
        written_by: format!("randt {}", randt_version::VERSION),
        ..Options::default()
    }
}

/// Ends a log; gives its size in bytes.
pub fn finish(log: LogFile, path: &Path) -> anyhow::Result<u64> {
    let context = || format!("{}: cannot be finished", path.display());
    log.finish().with_context(context)
}

/// A message that is only a head.
pub fn head_only<T: Topic>(head: &T::Head) -> MessageRef<'_, T> {
    MessageRef { head, items: &[] }
}

/// Prints a value: to programs as JSON, to people as a text.
pub fn print_value(
    as_json: bool,
    value: &impl Serialize,
    text: impl FnOnce() -> String,
) -> anyhow::Result<()> {
    print(&match as_json {
        true => json(value)?,
        false => text(),
    })
}

/// A value as JSON for programs and people.
pub fn json(value: &impl Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

/// Writes a line to standard error. Where the reader is gone the work goes on: `eprintln!` would
/// panic.
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

        // A link in the way of the temporary name leads to somebody else's file.
        let theirs = folder.path().join("theirs");
        fs::write(&theirs, b"theirs").unwrap();
        std::os::unix::fs::symlink(&theirs, folder.path().join("report.json.part")).unwrap();
        write_whole(&path, b"three").unwrap();
        assert_eq!(fs::read(&theirs).unwrap(), b"theirs");
        assert_eq!(fs::read(&path).unwrap(), b"three");
        fs::remove_file(&theirs).unwrap();

        // The final name is taken by a folder: nothing is left lying about.
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(write_whole(&taken, b"four").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}

//! Copying a mission out of a folder that somebody else may change meanwhile.
//!
//! Every file is opened below a folder that is open already, no link is followed, and what has
//! been opened is inspected: a plain file of the mission's owner is copied and nothing else is.

use crate::identity::Identity;
use crate::output::warn;
use crate::progress;
use anyhow::Context;
use rustix::fs::{Dir, FileType, Mode, OFlags, fstat, openat};
use rustix::io::Errno;
use std::ffi::{CStr, OsStr};
use std::fs::{self, File};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// A mission has two levels of folders; nobody needs more.
const DEPTH_MAX: usize = 8;
/// Locks mean nothing in a copy.
const LOCK: &str = "lock";
/// What is read and executed of a file by whom.
const MODE_BITS: u32 = 0o777;

/// What was copied.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Copied {
    pub bytes: u64,
    /// Files that are no plain ones of the mission's owner.
    pub left_out: u64,
}

/// Something in the mission's folder, open.
enum Found {
    Folder(OwnedFd),
    File {
        file: File,
        bytes: u64,
        mode: u32,
    },
    /// Why it is not copied.
    Other(&'static str),
}

/// Copies a folder into another one that is there. `reader`: with whose rights it is read; it is
/// written with those in force.
pub fn copy(reader: Identity, from: &Path, to: &Path) -> anyhow::Result<Copied> {
    let context = || format!("{}: cannot be read", from.display());
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder = reader.run(|| {
        let folder = openat(rustix::fs::CWD, from, flags, Mode::empty());
        folder.with_context(context)
    })?;
    let owner = fstat(&folder).with_context(context)?.st_uid;
    let mut copied = Copied::default();
    let mut total = 0;
    let tree = Tree { reader, owner };
    tree.walk(&folder, Path::new(""), &mut |_, found| {
        if let Found::File { bytes, .. } = found {
            total += bytes;
        }
        Ok(())
    })?;
    let bar = progress::bar(Some(total), "bytes");
    tree.walk(&folder, Path::new(""), &mut |name, found| {
        match found {
            Found::Folder(_) => fs::create_dir(to.join(name)),
            Found::File { mut file, mode, .. } => {
                let mut options = File::options();
                let options = options.write(true).create_new(true).mode(mode);
                let target = options.open(to.join(name));
                let size = target.and_then(|mut target| io::copy(&mut file, &mut target));
                size.map(|size| {
                    copied.bytes += size;
                    bar.inc(size);
                })
            }
            Found::Other(why) => {
                let shown = from.join(name);
                warn(&format!("{}: {why}; it is left out", shown.display()));
                copied.left_out += 1;
                Ok(())
            }
        }
        .with_context(|| format!("{}: cannot be copied", name.display()))
    })?;
    bar.finish_and_clear();
    Ok(copied)
}

/// A folder of whose owner's plain files something is to be done.
struct Tree {
    reader: Identity,
    owner: u32,
}

type Visit<'v> = dyn FnMut(&Path, Found) -> anyhow::Result<()> + 'v;

impl Tree {
    /// Visits what is in a folder, folders before what is in them.
    fn walk(&self, folder: &OwnedFd, name: &Path, visit: &mut Visit<'_>) -> anyhow::Result<()> {
        let read = self.reader.run(|| Ok(Dir::read_from(folder)?));
        for entry in read.with_context(|| name.display().to_string())? {
            let entry = entry.with_context(|| name.display().to_string())?;
            let entry_name = Path::new(OsStr::from_bytes(entry.file_name().to_bytes()));
            let is_lock = entry_name.extension().is_some_and(|ending| ending == LOCK);
            if matches!(entry.file_name().to_bytes(), b"." | b"..") || is_lock {
                continue;
            }
            let name: PathBuf = name.join(entry_name);
            let open = || self.open(folder, entry.file_name(), &name);
            match self.reader.run(open)? {
                Found::Folder(folder) if name.components().count() <= DEPTH_MAX => {
                    let below = folder.try_clone()?;
                    visit(&name, Found::Folder(folder))?;
                    self.walk(&below, &name, visit)?;
                }
                Found::Folder(_) => visit(&name, Found::Other("too many folders in folders"))?,
                other => visit(&name, other)?,
            }
        }
        Ok(())
    }

    /// Opens what is there without waiting for anybody, and inspects what it has got.
    fn open(&self, folder: impl AsFd, entry: &CStr, name: &Path) -> anyhow::Result<Found> {
        let flags =
            OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let file = match openat(folder, entry, flags, Mode::empty()) {
            Ok(file) => file,
            Err(Errno::LOOP) => return Ok(Found::Other("is a link")),
            Err(Errno::NXIO | Errno::NODEV) => return Ok(Found::Other("is no plain file")),
            Err(Errno::ACCESS) => return Ok(Found::Other("the mission's owner may not read it")),
            Err(Errno::NOENT) => return Ok(Found::Other("is not there any more")),
            Err(cause) => {
                return Err(cause).with_context(|| format!("{}: cannot be read", name.display()));
            }
        };
        let found = fstat(&file)?;
        Ok(match FileType::from_raw_mode(found.st_mode) {
            _ if found.st_uid != self.owner => Found::Other("is not the mission's owner's"),
            FileType::Directory => Found::Folder(file),
            FileType::RegularFile => Found::File {
                file: File::from(file),
                bytes: u64::try_from(found.st_size).unwrap_or(0),
                mode: found.st_mode & MODE_BITS,
            },
            _ => Found::Other("is no plain file"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, mknodat};
    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener;

    fn files(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().flatten();
        let mut names: Vec<String> = entries
            .map(|entry| entry.file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn plain_files_are_copied_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
        fs::create_dir_all(from.join("logs")).unwrap();
        fs::create_dir(&to).unwrap();
        fs::write(from.join("map.journal"), "map").unwrap();
        fs::write(from.join("map.journal.lock"), "").unwrap();
        fs::write(from.join("logs/a.mcap"), "log").unwrap();
        let secret = folder.path().join("secret");
        fs::write(&secret, "secret").unwrap();
        symlink(&secret, from.join("logs/link.mcap")).unwrap();
        symlink(folder.path(), from.join("folder")).unwrap();
        let mode = Mode::from_raw_mode(0o600);
        mknodat(CWD, from.join("pipe"), FileType::Fifo, mode, 0).unwrap();
        let _socket = UnixListener::bind(from.join("socket")).unwrap();
        let mut deep = from.clone();
        (0..=DEPTH_MAX).for_each(|_| deep.push("d"));
        fs::create_dir_all(&deep).unwrap();

        let copied = copy(Identity::of_caller(), &from, &to).unwrap();
        assert_eq!(
            copied,
            Copied {
                bytes: 6,
                left_out: 5
            }
        );
        assert_eq!(files(&to), ["d", "logs", "map.journal"]);
        assert_eq!(files(&to.join("logs")), ["a.mcap"]);
        // Nothing is written over.
        assert!(copy(Identity::of_caller(), &from, &to).is_err());
        // The folder itself is no link either.
        symlink(&from, folder.path().join("mission")).unwrap();
        assert!(copy(Identity::of_caller(), &folder.path().join("mission"), &to).is_err());
    }

    #[test]
    fn files_of_others_are_left_out_under_any_name() {
        if !rustix::process::geteuid().is_root() {
            assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
            return println!("not run: this user is not root");
        }
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
        fs::create_dir(&from).unwrap();
        fs::create_dir(&to).unwrap();
        fs::write(from.join("own"), "own").unwrap();
        // A hard link to a file of somebody else's is that file.
        let secret = folder.path().join("secret");
        fs::write(&secret, "secret").unwrap();
        std::os::unix::fs::chown(&secret, Some(65533), None).unwrap();
        fs::hard_link(&secret, from.join("hard")).unwrap();
        let copied = copy(Identity::of_caller(), &from, &to).unwrap();
        assert_eq!(
            copied,
            Copied {
                bytes: 3,
                left_out: 1
            }
        );
        assert_eq!(files(&to), ["own"]);
    }
}

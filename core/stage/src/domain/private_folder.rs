//! Folders in which only this user and root can change anything.
//!
//! A user who can write to a folder can put another folder, or a link, in the place of what is in
//! it. So a path is trusted if every folder and link on the way to it belongs to this user or to
//! root. Then no other user can change where the path leads, and what lies below a folder that was
//! checked may be used by its path.

use super::user;
use crate::Error;
use rustix::fs::{Mode, OFlags, Stat, fchmod, fstat, open};
use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::Path;

/// Mode of what only this user uses.
const PRIVATE: u32 = 0o700;
/// Bits by which its group and all others may write to a folder.
const WRITTEN_BY_OTHERS: u32 = 0o022;
const WRITTEN_BY_ALL: u32 = 0o002;
/// Where all users may write, as in /tmp, this lets only its owner rename or remove a file.
const STICKY: u32 = 0o1000;
/// The kernel has the same limit.
const LINKS_MAX: usize = 40;

/// Refuses a path on which another user could put something else in the place of what is there.
/// `make`: folders that are not there are made, for this user alone.
pub(crate) fn check_way_to(path: &Path, make: bool) -> Result<(), Error> {
    check_way(path, make, LINKS_MAX)
}

fn check_way(path: &Path, make: bool, links_left: usize) -> Result<(), Error> {
    let mut ancestors: Vec<&Path> = path.ancestors().collect();
    ancestors.reverse();
    for ancestor in ancestors {
        if make && !is_there(ancestor) {
            self::make(ancestor)?;
        }
        let found = match fs::symlink_metadata(ancestor) {
            Ok(found) => found,
            // It does not exist, or this user may not see it and so cannot use it either.
            Err(error) if is_hidden(&error) => return Ok(()),
            Err(cause) => return Err(Error::file(ancestor, "cannot be read")(cause)),
        };
        if !is_trusted(found.uid()) {
            return Err(other_user(ancestor, found.uid()));
        }
        if found.is_symlink() {
            let Some(links_left) = links_left.checked_sub(1) else {
                let cause = ErrorKind::InvalidInput.into();
                return Err(Error::file(ancestor, "is a cycle of links")(cause));
            };
            let target = fs::read_link(ancestor);
            let target = target.map_err(Error::file(ancestor, "cannot be read"))?;
            let from = ancestor.parent().unwrap_or(ancestor);
            check_way(&from.join(target), make, links_left)?;
        } else if found.mode() & WRITTEN_BY_ALL != 0 && found.mode() & STICKY == 0 {
            return Err(open_to_others(ancestor, found.mode()));
        }
    }
    Ok(())
}

/// This user, or root. The owner of the root folder counts as root: a user namespace may have
/// another number for it.
fn is_trusted(owner: u32) -> bool {
    owner == user() || owner == 0 || fs::metadata("/").is_ok_and(|root| root.uid() == owner)
}

/// Makes a folder for this user alone, unless something of that name exists.
pub(crate) fn make(path: &Path) -> Result<(), Error> {
    match DirBuilder::new().mode(PRIVATE).create(path) {
        Err(cause) if cause.kind() != ErrorKind::AlreadyExists => {
            Err(Error::file(path, "cannot be made")(cause))
        }
        _ => Ok(()),
    }
}

/// Refuses a link, what is no folder of root's or this user's, and a folder in which others can
/// write.
pub(crate) fn check_trusted(path: &Path) -> Result<(), Error> {
    open_checked(path).map(|_| ())
}

/// Refuses a folder that is not this user's own, or in which another user can write.
pub(crate) fn check_own(path: &Path) -> Result<(), Error> {
    open_own(path).map(|_| ())
}

/// The same; other users cannot read it from now on.
pub(crate) fn take_for_own(path: &Path) -> Result<(), Error> {
    let (folder, found) = open_own(path)?;
    if found.st_mode & 0o777 == PRIVATE {
        return Ok(());
    }
    let set = fchmod(&folder, Mode::from_raw_mode(PRIVATE));
    set.map_err(|cause| Error::file(path, "its mode cannot be set")(cause.into()))
}

fn open_own(path: &Path) -> Result<(OwnedFd, Stat), Error> {
    let (folder, found) = open_checked(path)?;
    if found.st_uid == user() {
        Ok((folder, found))
    } else {
        Err(other_user(path, found.st_uid))
    }
}

fn open_checked(path: &Path) -> Result<(OwnedFd, Stat), Error> {
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let opened = open(path, flags, Mode::empty());
    let opened = opened.and_then(|folder| Ok((fstat(&folder)?, folder)));
    let (found, folder) = opened.map_err(|cause| match fs::symlink_metadata(path) {
        // It cannot be opened because another user owns it.
        Ok(found) if found.uid() != user() => other_user(path, found.uid()),
        _ => Error::file(path, "is no folder, or cannot be opened")(cause.into()),
    })?;
    if !is_trusted(found.st_uid) {
        return Err(other_user(path, found.st_uid));
    }
    if found.st_mode & WRITTEN_BY_OTHERS != 0 {
        return Err(open_to_others(path, found.st_mode));
    }
    Ok((folder, found))
}

pub(crate) fn other_user(path: &Path, owner: u32) -> Error {
    Error::OtherUser {
        path: path.to_owned(),
        owner,
        user: user(),
    }
}

fn open_to_others(path: &Path, mode: u32) -> Error {
    Error::OpenToOthers {
        path: path.to_owned(),
        mode: mode & 0o7777,
    }
}

fn is_there(path: &Path) -> bool {
    !matches!(fs::symlink_metadata(path), Err(error) if error.kind() == ErrorKind::NotFound)
}

/// It does not exist, or this user may not see it.
pub(crate) fn is_hidden(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::NotFound | ErrorKind::PermissionDenied
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, set_permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn mode(path: &Path, mode: u32) {
        set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn a_folder_is_trusted_where_no_other_user_can_write() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("a/b/run");
        check_way_to(&run, true).unwrap();
        assert_eq!(fs::metadata(&run).unwrap().mode() & 0o777, 0o700);
        for (bits, is_good) in [
            (0o700, true),
            (0o755, true),
            (0o770, false),
            (0o1777, false),
        ] {
            mode(&run, bits);
            assert_eq!(check_trusted(&run).is_ok(), is_good, "{bits:o}");
        }
        mode(&run, 0o755);
        take_for_own(&run).unwrap();
        assert_eq!(fs::metadata(&run).unwrap().mode() & 0o777, 0o700);
        // A user who can write to a folder on the way can put another one there.
        mode(&folder.path().join("a"), 0o777);
        let error = check_way_to(&run, false).unwrap_err().to_string();
        assert!(error.contains("/a: mode 777"), "{error}");
        mode(&folder.path().join("a"), 0o1777);
        check_way_to(&run, false).unwrap();
    }

    #[test]
    fn a_link_is_no_folder_and_a_cycle_of_links_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("there")).unwrap();
        symlink("there", path("link")).unwrap();
        assert!(check_trusted(&path("link")).is_err());
        check_way_to(&path("link/run"), false).unwrap();
        symlink("round", path("round")).unwrap();
        assert!(check_way_to(&path("round/run"), true).is_err());
        fs::write(path("file"), "").unwrap();
        assert!(check_trusted(&path("file")).is_err());
        assert!(check_way_to(&path("file/run"), true).is_err());
    }
}

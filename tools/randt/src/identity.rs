//! Whose rights a command of root's has while it works in the folders of other users.
//!
//! The owner of a folder can put links in it, at any moment. Root would follow them to what is
//! root's alone. So below such a folder a command of root's may do what the folder's owner may do,
//! and nothing else. Real and saved user stay root: that lets it go back, and lets nobody but root
//! send it signals or look into it.

use anyhow::{Context, bail, ensure};
use rustix::process::{Gid, Uid, getegid, geteuid, getgid, getgroups, getuid};
use rustix::thread::{set_thread_groups, set_thread_res_gid, set_thread_res_uid};
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, absolute};

/// The kernel follows no more links than that either.
const LINKS_MAX: u32 = 40;
/// Everybody may write to a folder, and only its owner may remove or rename what is in it.
const WRITTEN_BY_ALL: u32 = 0o002;
const STICKY: u32 = 0o1000;

/// A user and a group whose rights a command may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    user: Uid,
    group: Gid,
}

impl Identity {
    /// Of the user that has started this process.
    pub fn of_caller() -> Self {
        Self {
            user: getuid(),
            group: getgid(),
        }
    }

    /// Of this process at this moment.
    pub fn in_force() -> Self {
        Self {
            user: geteuid(),
            group: getegid(),
        }
    }

    /// Root's: of the first one but root who owns a folder or a link on the way to `path`, which
    /// need not be there; of root, where there is none. Anybody else has his own only.
    ///
    /// Nobody but root can change where the way leads up to there.
    pub fn of_way_to(path: &Path) -> anyhow::Result<Self> {
        let caller = Self::of_caller();
        caller.run(|| {
            if !caller.user.is_root() {
                return Ok(caller);
            }
            let path = absolute(path).with_context(|| path.display().to_string())?;
            Ok(first_owner(&path, LINKS_MAX)?.unwrap_or(caller))
        })
    }

    /// Does something with these rights, and nothing with any others. Those from before are back
    /// when it is done.
    pub fn run<T>(self, work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
        let before = Self::in_force();
        if self == before {
            return work();
        }
        let groups = getgroups().context("the groups of this process")?;
        // A user's other groups give no right below a folder that is his.
        self.take_on(&[])
            .with_context(|| format!("the rights of user {} cannot be taken on", self.user))?;
        let done = work();
        before
            .take_on(&groups)
            .context("the rights of before cannot be had again")?;
        done.with_context(|| match self.user.is_root() {
            true => "as root".to_owned(),
            false => format!("with the rights of user {}, who owns the folder", self.user),
        })
    }

    /// Of this thread, and of those that it starts from now on.
    fn take_on(self, groups: &[Gid]) -> rustix::io::Result<()> {
        let (same_user, same_group) = (None::<Uid>, None::<Gid>);
        set_thread_res_uid(same_user, getuid(), same_user)?;
        set_thread_groups(groups)?;
        set_thread_res_gid(same_group, self.group, same_group)?;
        set_thread_res_uid(same_user, self.user, same_user)
    }
}

/// The first one but root who owns something on a way.
fn first_owner(path: &Path, links_left: u32) -> anyhow::Result<Option<Identity>> {
    let mut ancestors: Vec<&Path> = path.ancestors().collect();
    ancestors.reverse();
    for ancestor in ancestors {
        let shown = ancestor.display();
        let found = match fs::symlink_metadata(ancestor) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            // A file cannot have anything below it; opening the path fails with that.
            Err(error) if error.kind() == ErrorKind::NotADirectory => return Ok(None),
            found => found.with_context(|| shown.to_string())?,
        };
        let user = Uid::from_raw(found.uid());
        // A user namespace may have another number for root: the owner of the root folder.
        if !user.is_root() && fs::metadata("/").is_ok_and(|root| root.uid() != found.uid()) {
            let group = Gid::from_raw(found.gid());
            return Ok(Some(Identity { user, group }));
        }
        if found.is_symlink() {
            ensure!(links_left > 0, "{shown}: leads round in a circle");
            let target = fs::read_link(ancestor).with_context(|| shown.to_string())?;
            let from = ancestor.parent().unwrap_or(ancestor);
            if let Some(owner) = first_owner(&from.join(target), links_left - 1)? {
                return Ok(Some(owner));
            }
        } else if found.mode() & WRITTEN_BY_ALL != 0 && found.mode() & STICKY == 0 {
            bail!(
                "{shown}: everybody may change what is in it: root does nothing there (chmod o-w {shown})"
            );
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;
    use std::os::unix::fs::{PermissionsExt, lchown, symlink};
    use std::path::PathBuf;

    const STRANGER: u32 = 65533;

    fn root() -> Option<tempfile::TempDir> {
        if !geteuid().is_root() {
            assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
            println!("not run: this user is not root");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
        Some(folder)
    }

    #[test]
    fn the_first_owner_on_the_way_counts() {
        let Some(folder) = root() else { return };
        let path = |name: &str| -> PathBuf { folder.path().join(name) };
        let user = |name: &str| Identity::of_way_to(&path(name)).unwrap().user.as_raw();
        fs::create_dir_all(path("a/b")).unwrap();
        assert_eq!((user("a/b"), user("a/not/there")), (0, 0));
        lchown(path("a/b"), Some(STRANGER), Some(7)).unwrap();
        assert_eq!(
            (user("a/b"), user("a/b/c/d"), user("a/c")),
            (STRANGER, STRANGER, 0)
        );
        assert_eq!(Identity::of_way_to(&path("a/b")).unwrap().group.as_raw(), 7);
        // What a folder further down is makes no difference.
        fs::create_dir(path("a/b/root")).unwrap();
        assert_eq!(user("a/b/root/x"), STRANGER);
        // Links: whose they are, and where they lead.
        symlink("a/b", path("root-link")).unwrap();
        assert_eq!(user("root-link/x"), STRANGER);
        symlink("/etc", path("link")).unwrap();
        assert_eq!(user("link/x"), 0);
        lchown(path("link"), Some(STRANGER), Some(7)).unwrap();
        assert_eq!(user("link/x"), STRANGER);
        symlink("round", path("round")).unwrap();
        assert!(Identity::of_way_to(&path("round/x")).is_err());
        fs::set_permissions(path("a"), Permissions::from_mode(0o777)).unwrap();
        let error = Identity::of_way_to(&path("a/c")).unwrap_err().to_string();
        assert!(error.contains("everybody may change"), "{error}");
        fs::set_permissions(path("a"), Permissions::from_mode(0o1777)).unwrap();
        assert_eq!(user("a/c"), 0);
    }

    #[test]
    fn rights_are_given_up_and_had_again() {
        let Some(folder) = root() else { return };
        let secret = folder.path().join("secret");
        fs::write(&secret, "root's").unwrap();
        fs::set_permissions(&secret, Permissions::from_mode(0o600)).unwrap();
        let theirs = folder.path().join("theirs");
        fs::create_dir(&theirs).unwrap();
        lchown(&theirs, Some(STRANGER), Some(STRANGER)).unwrap();
        symlink(&secret, theirs.join("link")).unwrap();
        let stranger = Identity::of_way_to(&theirs).unwrap();
        let text = || fs::read_to_string(theirs.join("link"));
        assert!(text().is_ok());
        let done = stranger.run(|| {
            assert!(text().is_err(), "root's file was read through a link");
            fs::write(theirs.join("file"), "")?;
            // Within it, what is the caller's to do.
            assert!(Identity::of_caller().run(|| Ok(text().is_ok()))?);
            assert!(text().is_err());
            assert!(getgroups()?.is_empty());
            bail!("it fails")
        });
        let error = format!("{:#}", done.map(|()| 0).unwrap_err());
        assert!(
            error.contains("rights of user 65533") && error.ends_with("it fails"),
            "{error}"
        );
        assert!(text().is_ok(), "root again");
        assert_eq!(fs::metadata(theirs.join("file")).unwrap().uid(), STRANGER);
    }
}

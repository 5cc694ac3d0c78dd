//! A robot whose folders belong to the stages' user, and what is root's beside them.

use super::{SECRET, USER};
use crate::support::{Ended, ended, names, randt};
use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, lchown, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A robot whose missions are the stages' user's, and what is root's beside that.
pub(super) struct Robot {
    pub(super) folder: tempfile::TempDir,
}

impl Robot {
    /// None where this user cannot become another one.
    pub(super) fn new() -> Option<Self> {
        if !rustix::process::geteuid().is_root() {
            assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
            println!("not run: this user is not root");
            return None;
        }
        let robot = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let folder = robot.folder.path();
        fs::set_permissions(folder, Permissions::from_mode(0o755)).unwrap();
        for name in ["missions", "run", "stick", "victim/state", "victim/bus"] {
            fs::create_dir_all(folder.join(name)).unwrap();
        }
        for name in ["missions", "run"] {
            give(&folder.join(name));
        }
        for name in ["secret", "victim/state/keep", "victim/bus/keep"] {
            fs::write(folder.join(name), SECRET).unwrap();
            fs::set_permissions(folder.join(name), Permissions::from_mode(0o600)).unwrap();
        }
        Some(robot)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Where the missions are.
    pub(super) fn root(&self) -> PathBuf {
        self.path("missions")
    }

    /// The folder of one.
    pub(super) fn mission(&self, name: &str) -> PathBuf {
        self.root().join("missions").join(name)
    }

    /// `randt mission ...` of root's. No pipeline is there.
    pub(super) fn randt(&self, arguments: &[&str]) -> Ended {
        let mut command = randt(&["mission"]);
        command.args(arguments).arg("--root").arg(self.root());
        if matches!(arguments[0], "new" | "stop") {
            command.arg("--run").arg(self.path("run"));
        }
        ended(command)
    }

    /// Begins a mission, as root.
    pub(super) fn begin(&self, name: &str) {
        let new = self.randt(&["new", name]);
        assert_eq!(new.code, Some(0), "{}", new.stderr);
    }

    /// Nothing of root's has changed, and nothing of it lies where others can read it.
    pub(super) fn check(&self) {
        for name in ["secret", "victim/state/keep", "victim/bus/keep"] {
            let found = fs::metadata(self.path(name)).unwrap();
            assert_eq!(
                (found.uid(), found.gid(), found.mode() & 0o777),
                (0, 0, 0o600),
                "{name}"
            );
            assert_eq!(
                fs::read_to_string(self.path(name)).unwrap(),
                SECRET,
                "{name}"
            );
        }
        assert_eq!(names(&self.path("victim")), ["bus", "state"]);
        for name in ["victim", "victim/state", "victim/bus"] {
            assert_eq!(fs::metadata(self.path(name)).unwrap().uid(), 0, "{name}");
        }
        // On the stick everybody may read all of it; beside the missions what belongs to their
        // owner.
        let stick = below(&self.path("stick"));
        let mut missions = below(&self.path("missions"));
        missions.retain(|file| fs::symlink_metadata(file).unwrap().uid() == USER);
        for file in stick.into_iter().chain(missions) {
            let bytes = fs::read(&file).unwrap();
            let mut parts = bytes.windows(SECRET.len());
            let found = parts.any(|part| part == SECRET.as_bytes());
            assert!(!found, "{}: is root's secret", file.display());
        }
    }
}

/// Gives a file, folder or link to the stages' user.
pub(super) fn give(path: &Path) {
    lchown(path, Some(USER), Some(USER)).unwrap();
}

/// Copies a program. By another process: one that any thread of this one starts meanwhile would
/// have the copy open for writing for a moment, and what is open for writing cannot be started.
pub(super) fn copy(program: &Path, to: &Path) {
    let mut cp = Command::new("cp");
    assert!(cp.arg(program).arg(to).status().unwrap().success());
}

/// A link of the stages' user's.
pub(super) fn plant(to: &Path, at: &Path) {
    symlink(to, at).unwrap();
    give(at);
}

/// Plain files below a folder; links are not followed.
pub(super) fn below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => files.extend(below(&entry.path())),
            Ok(kind) if kind.is_file() => files.push(entry.path()),
            _ => {}
        }
    }
    files
}

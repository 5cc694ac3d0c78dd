//! The programs in a folder of their own, where one of them can be missing or another one.

use super::stages::program;
use randt_stage::STAGES;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

/// randt and its stages, side by side as they are installed.
pub struct Programs {
    folder: tempfile::TempDir,
}

impl Programs {
    /// Those that were built.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let randt = Path::new(env!("CARGO_BIN_EXE_randt"));
        let own = folder.path().join("randt");
        // A link of its own: it looks for the others beside the name that it was started by.
        fs::hard_link(randt, &own)
            .or_else(|_| fs::copy(randt, &own).map(|_| ()))
            .unwrap();
        for stage in STAGES {
            let link = folder.path().join(format!("randt-{stage}"));
            symlink(program(stage), link).unwrap();
        }
        Self { folder }
    }

    /// A command of this randt.
    pub fn randt(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(self.folder.path().join("randt"));
        command.args(arguments);
        command
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("randt-{name}"))
    }

    /// Takes a stage's program away.
    pub fn remove(&self, name: &str) {
        fs::remove_file(self.path(name)).unwrap();
    }

    /// Puts one in its place that fails with these words.
    pub fn break_down(&self, name: &str, words: &str) {
        let path = self.path(name);
        let new = self.folder.path().join("new");
        fs::write(&new, format!("#!/bin/sh\necho '{words}' >&2\nexit 1\n")).unwrap();
        fs::set_permissions(&new, fs::Permissions::from_mode(0o755)).unwrap();
        fs::rename(new, path).unwrap();
    }
}

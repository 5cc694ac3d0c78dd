//! A robot with missions.

use crate::support::pipeline::Pipeline;
use crate::support::{Ended, ended, names, randt, run};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A robot: the folder of its missions.
pub(super) struct Robot {
    pub(super) root: tempfile::TempDir,
}

impl Robot {
    pub(super) fn new() -> Self {
        Self {
            root: tempfile::tempdir().unwrap(),
        }
    }

    pub(super) fn current(&self) -> PathBuf {
        self.root.path().join("current")
    }

    /// `randt mission ...`, without a pipeline.
    pub(super) fn mission(&self, arguments: &[&str]) -> Ended {
        let mut command = randt(&["mission"]);
        command.args(arguments).arg("--root").arg(self.root.path());
        ended(command)
    }

    /// What systemd does at the start.
    pub(super) fn boot(&self, pipeline: &Pipeline) -> String {
        let mut command = pipeline.command(&["mission", "boot"]);
        command.arg("--root").arg(self.root.path());
        let ended = ended(command);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        ended.stdout
    }

    /// `randt mission stop` for the pipeline of a run folder.
    pub(super) fn stop(&self, pipeline: &Pipeline) -> Ended {
        let mut command = pipeline.command(&["mission", "stop"]);
        command.arg("--root").arg(self.root.path());
        ended(command)
    }

    /// `randt run` of the mission's only log.
    pub(super) fn run(&self) -> PathBuf {
        let logs = self.current().join("logs");
        let names = names(&logs);
        assert_eq!(names.len(), 1, "{names:?}");
        let out = self.root.path().join("run");
        let computed = run(&logs.join(&names[0]), &out, &[]);
        assert_eq!(computed.code, Some(0), "{}", computed.stderr);
        out
    }

    /// The stages, and a drive.
    pub(super) fn drive(&self, pipeline: &mut Pipeline, log: &Path) {
        pipeline.record(&self.current().join("logs"), &[]);
        pipeline.compute(&self.current());
        pipeline.play(log, &["--rate", "2", "--stay"]);
    }

    pub(super) fn list(&self) -> Vec<(String, String)> {
        let list = self.mission(&["list", "--json"]);
        assert_eq!(list.code, Some(0), "{}", list.stderr);
        let rows: Value = serde_json::from_str(&list.stdout).unwrap();
        let text = |row: &Value, key: &str| row[key].as_str().unwrap().to_owned();
        let rows = rows.as_array().unwrap().iter();
        rows.map(|row| (text(row, "name"), text(row, "state")))
            .collect()
    }
}

pub(super) fn name_in(output: &str) -> String {
    output.split(':').next().unwrap().to_owned()
}

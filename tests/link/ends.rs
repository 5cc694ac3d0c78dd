//! A robot, its base and the link between them.

use crate::support::ended;
use crate::support::pipeline::Pipeline;
use crate::support::stages::program;
use rustix::process::Signal;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A robot's pipeline and the base's of it, and the link between them.
pub struct Ends {
    pub robot: Pipeline,
    pub base: Pipeline,
    pub folder: tempfile::TempDir,
    /// The robot's keyframes for the base.
    pub journal: PathBuf,
    /// Where the base listens.
    pub address: String,
    pub links: [Option<u32>; 2],
}

/// Which end.
#[derive(Clone, Copy, PartialEq)]
pub enum End {
    Robot,
    Base,
}
pub use End::{Base, Robot};

impl Ends {
    /// Without a link yet. `more`: lines of the section `link` for both ends.
    pub fn new(more: &str) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap().to_string();
        Self::at(&address, more)
    }

    pub fn at(address: &str, more: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let ends = Self {
            robot: Pipeline::new("lr"),
            base: Pipeline::new("lb"),
            journal: folder.path().join("link.journal"),
            folder,
            address: address.to_owned(),
            links: [None; 2],
        };
        for (end, role) in [(Robot, "robot"), (Base, "base")] {
            let text = format!(
                "[link]\nrole = \"{role}\"\nrobot = \"spot\"\naddress = \"{address}\"\n{more}\n"
            );
            std::fs::write(ends.configuration(end), text).unwrap();
        }
        ends
    }

    pub fn configuration(&self, end: End) -> PathBuf {
        self.folder
            .path()
            .join(["robot.toml", "base.toml"][end as usize])
    }

    pub fn pipeline(&mut self, end: End) -> &mut Pipeline {
        match end {
            Robot => &mut self.robot,
            Base => &mut self.base,
        }
    }

    /// Starts the link's process at one end.
    pub fn link(&mut self, end: End) {
        self.link_by(end, Command::new(program("link")));
    }

    pub fn link_by(&mut self, end: End, mut command: Command) {
        command.arg("--robot").arg(self.configuration(end));
        if end == Robot {
            command.arg("--journal").arg(&self.journal);
        }
        let pipeline = self.pipeline(end);
        pipeline.enter(&mut command);
        let name = ["link", "link-base"][end as usize];
        let pid = pipeline.start(name, command);
        self.links[end as usize] = Some(pid);
    }

    pub fn kill_link(&mut self, end: End) {
        let pid = self.links[end as usize].take().unwrap();
        self.pipeline(end).end(pid, Signal::KILL);
    }
}

/// Makes keys in a folder.
pub fn keys(folder: &Path, name: &str, days: &str) {
    let mut command = Command::new(program("link"));
    command.arg("keys").arg(folder).args([name, "--days", days]);
    let made = ended(command);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
}

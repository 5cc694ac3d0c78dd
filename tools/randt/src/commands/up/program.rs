//! A program of the pipeline, and how it is started.

use anyhow::Context;
use randt_stage::Domain;
use std::ffi::{OsStr, OsString};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// What to start.
pub struct Program {
    pub name: String,
    pub path: PathBuf,
    pub arguments: Vec<OsString>,
    /// Whether it is not started again: a log that begins anew would be another drive.
    pub once: bool,
}

impl Program {
    /// A stage's own program, which stands beside this one.
    pub fn stage(name: &str, domain: &Domain) -> anyhow::Result<Self> {
        let this = std::env::current_exe().context("this program's own path")?;
        let path = this.with_file_name(format!("randt-{name}"));
        Ok(Self::new(name, path, domain))
    }

    /// A command of this program.
    pub fn command(name: &str, domain: &Domain) -> anyhow::Result<Self> {
        let this = std::env::current_exe().context("this program's own path")?;
        let mut program = Self::new(name, this, domain);
        program.arguments.insert(0, name.into());
        program.once = true;
        Ok(program)
    }

    /// One with the options that lead into the pipeline.
    pub fn new(name: &str, path: PathBuf, domain: &Domain) -> Self {
        let mut program = Self {
            name: name.to_owned(),
            path,
            arguments: Vec::new(),
            once: false,
        };
        program.option("--prefix", domain.prefix());
        program.option("--run", domain.run());
        program.option("--parent", std::process::id().to_string());
        program
    }

    /// Adds an option with its value.
    pub fn option(&mut self, name: &str, value: impl AsRef<OsStr>) {
        self.flag(name);
        self.flag(value);
    }

    /// Adds one argument.
    pub fn flag(&mut self, argument: impl AsRef<OsStr>) {
        self.arguments.push(argument.as_ref().to_owned());
    }

    /// Starts it once.
    pub fn start(&self) -> std::io::Result<Child> {
        Command::new(&self.path)
            .args(&self.arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Ctrl-C is for the supervisor, which ends its children in order.
            .process_group(0)
            .spawn()
    }
}

//! The options that every program of the pipeline shares.

use crate::{Domain, Error, Stage};
use randt_config::SelectionArguments;
use std::path::PathBuf;

/// Which pipeline a program belongs to.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Pipeline")]
pub struct DomainArguments {
    /// Name of the pipeline: programs with the same one see each other, others do not
    #[arg(long, value_name = "NAME", default_value = "randt")]
    pub prefix: String,
    /// Folder in memory for what must survive a stage, in which no other user can write;
    /// /run/randt if that exists, else $XDG_RUNTIME_DIR/randt, else /dev/shm/randt-UID
    #[arg(long, value_name = "DIR")]
    pub run: Option<PathBuf>,
}

impl DomainArguments {
    /// The domain.
    pub fn domain(&self) -> Result<Domain, Error> {
        Domain::new(&self.prefix, self.run.as_deref())
    }
}

/// Options of a stage.
#[derive(Clone, Debug, clap::Args)]
pub struct StageArguments {
    #[command(flatten)]
    domain: DomainArguments,
    /// The configuration that the stage computes by.
    #[command(flatten)]
    pub selection: SelectionArguments,
    /// End with this process, which has started the stage
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

impl StageArguments {
    /// Enters the pipeline under a name.
    pub fn open(&self, name: &str) -> Result<Stage, Error> {
        if let Some(parent) = self.parent {
            crate::end_with(parent);
        }
        Stage::open(name, &self.domain.domain()?)
    }
}

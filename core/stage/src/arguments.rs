//! The options that name a realm, shared by every program of the pipeline.

use crate::{Error, Realm};
use std::path::PathBuf;

/// Which pipeline a program belongs to.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Pipeline")]
pub struct RealmArguments {
    /// Name of the pipeline: programs with the same one see each other, others do not
    #[arg(long, value_name = "NAME", default_value = "randt")]
    pub prefix: String,
    /// Folder in memory for what must survive a stage; /run/randt where that is, else /dev/shm/randt-UID
    #[arg(long, value_name = "DIR")]
    pub run: Option<PathBuf>,
}

impl RealmArguments {
    /// The realm.
    pub fn realm(&self) -> Result<Realm, Error> {
        Realm::new(&self.prefix, self.run.as_deref())
    }
}

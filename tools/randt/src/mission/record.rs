//! A mission's record: `mission.json`.

use crate::date::BootTime;
use crate::plain_file;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Its name.
pub const FILE: &str = "mission.json";

/// The contents of `mission.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
pub struct Record {
    /// Version of the program that began it.
    pub randt: String,
    /// Its number among the robot's missions, from 1 on; 0 where an older version began it. Dates
    /// may be wrong, this is not.
    #[serde(default)]
    pub number: u64,
    /// When it began, ns since 1970 of the system's clock.
    pub begun_ns: i64,
    /// When it was stopped; not for one that runs, or that a power cut ended.
    #[serde(default)]
    pub stopped_ns: Option<i64>,
    /// When it went on after it had been interrupted.
    #[serde(default)]
    pub resumed_ns: Vec<i64>,
    /// How often it went on without what the stages had in memory.
    #[serde(default)]
    pub power_cuts: u64,
    /// When it began or went on last, by a clock that cannot be set.
    #[serde(default)]
    pub boot: Option<BootTime>,
    /// What another version has written beside that.
    #[serde(flatten)]
    pub others: BTreeMap<String, serde_json::Value>,
}

impl Record {
    /// Reads that of a mission's folder.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let text = plain_file::read_to_string(&folder.join(FILE)).context(FILE)?;
        serde_json::from_str(&text).context(FILE)
    }
}

/// Gives what stands in a record's place another name, the first that is free; gives that name.
pub fn keep_broken(folder: &Path) -> anyhow::Result<Option<String>> {
    let names = (1_u64..).map(|number| format!("{FILE}.broken-{number}"));
    let is_free = |name: &String| fs::symlink_metadata(folder.join(name)).is_err();
    let free = { names }.find(is_free);
    let free = free.context("all names are taken")?;
    match fs::rename(folder.join(FILE), folder.join(&free)) {
        Ok(()) => Ok(Some(free)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => {
            Err(error).with_context(|| format!("{}: cannot be kept", folder.join(FILE).display()))
        }
    }
}

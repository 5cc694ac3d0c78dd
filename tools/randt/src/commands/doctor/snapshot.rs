//! What the checks look at: the domain, its register, and every process that may have to do with
//! it.

use super::processes::{self, FileId, Process};
use crate::identity::Identity;
use randt_stage::{Domain, Entry, Error, Registry};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::time::Duration;

/// What may be over in a moment is looked at again after this time.
pub const AGAIN: Duration = Duration::from_millis(200);

/// A domain as it was found.
pub struct DomainSnapshot {
    /// The domain.
    pub domain: Domain,
    /// The user that this process is.
    pub user: u32,
    /// Owner of the domain's folder, or of the run folder where that hides it; none where it is
    /// not there.
    pub owner: Option<u32>,
    /// All stages that ever ran in it, with whether they live.
    pub register: Vec<(Entry, bool)>,
    /// Stages and tools of all domains.
    pub processes: Vec<Process>,
    presence: Option<FileId>,
}

impl DomainSnapshot {
    /// Reads what is there now.
    pub fn take(domain: Domain) -> Self {
        let folder = domain.folder();
        Self {
            user: rustix::process::geteuid().as_raw(),
            owner: owner(&domain),
            register: Registry::all(&domain),
            // Root sees those of all users.
            processes: Identity::of_caller()
                .run(|| Ok(processes::all()))
                .unwrap_or_default(),
            presence: processes::presence(&folder),
            domain,
        }
    }

    /// Whether a process is in this domain.
    pub fn is_in(&self, process: &Process) -> bool {
        match (process.presence, self.presence) {
            (Some(theirs), Some(ours)) => theirs == ours,
            _ => process.folder == self.domain.folder() && !process.removed,
        }
    }

    /// The processes in this domain.
    pub fn inside(&self) -> impl Iterator<Item = &Process> {
        self.processes.iter().filter(|process| self.is_in(process))
    }

    /// The living stages of the register.
    pub fn living(&self) -> impl Iterator<Item = &Entry> {
        let living = self.register.iter().filter(|(_, lives)| *lives);
        living.map(|(entry, _)| entry)
    }

    /// What is found now and a moment later again: what a stage that starts or ends has made and
    /// not yet opened, or not yet removed, is nothing to report.
    pub fn lasting<T: PartialEq>(&self, find: impl Fn(&Self) -> Vec<T>) -> Vec<T> {
        let before = find(self);
        if before.is_empty() {
            return before;
        }
        std::thread::sleep(AGAIN);
        let mut still = find(&Self::take(self.domain.clone()));
        still.retain(|it| before.contains(it));
        still
    }

    /// Options that lead other programs here.
    pub fn options(&self) -> String {
        let (prefix, run) = (self.domain.prefix(), self.domain.run().display());
        format!("--prefix {prefix} --run {run}")
    }
}

/// The command that starts a stage again, as it was started.
pub fn start(entry: &Entry) -> String {
    let mut words = entry.command.iter();
    let mut command = Vec::new();
    while let Some(word) = words.next() {
        // Its supervisor is not the one who copies this.
        if word == "--parent" {
            words.next();
        } else {
            command.push(quoted(word));
        }
    }
    command.join(" ")
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// The program of a stage, as people know it.
pub fn program(stage: &str) -> String {
    match stage {
        "up" | "play" => format!("randt {stage}"),
        _ => format!("randt-{stage}"),
    }
}

fn owner(domain: &Domain) -> Option<u32> {
    match domain.check_owner() {
        Err(Error::OtherUser { owner, .. }) => Some(owner),
        _ => Some(fs::metadata(domain.folder()).ok()?.uid()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_given_as_it_was_started_without_its_supervisor() {
        let words = [
            "./randt-mapper",
            "--parent",
            "7",
            "--journal",
            "my map",
            "--set",
            "a.b='c'",
        ];
        let entry = Entry {
            command: words.map(str::to_owned).to_vec(),
            ..Entry::default()
        };
        let expected = r"./randt-mapper --journal 'my map' --set 'a.b='\''c'\'''";
        assert_eq!(start(&entry), expected);
    }
}

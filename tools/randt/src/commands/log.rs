//! `randt log`: what can be done with a log; one file for each action.

mod check;
mod cut;
mod export;
mod info;
pub mod recover;

use crate::exit::Outcome;
use crate::output::{finish, may_write};
use crate::units::bytes;
use randt_log::{Compression, Entry, LogFile, LogReader, Options, copy};
use std::io::{Read, Seek};
use std::path::Path;

/// What to do.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Summarise a log: topics, rates, span, metadata; exit code 3 where something is missing
    Info(info::Arguments),
    /// Read every byte and every checksum; exit code 3 where something is damaged or was not
    /// recorded
    Check(check::Arguments),
    /// Make a whole log of one that was cut: by a power cut, a kill, a half copy
    Recover(recover::Arguments),
    /// Make a log of a part of another
    Cut(cut::Arguments),
    /// Write a log in another format: CSV, TUM, ROS 1 bag, ROS 2 bag, MCAP for viewers
    Export(export::Arguments),
}

/// Does it.
pub fn run(action: Action) -> anyhow::Result<Outcome> {
    match action {
        Action::Info(arguments) => info::run(&arguments),
        Action::Check(arguments) => check::run(&arguments),
        Action::Recover(arguments) => recover::run(&arguments),
        Action::Cut(arguments) => cut::run(&arguments),
        Action::Export(arguments) => export::run(&arguments),
    }
}

/// Writes a log anew with the messages that are wanted; gives the text about it.
fn write_copy<R: Read + Seek>(
    reader: &mut LogReader<R>,
    to: &Path,
    force: bool,
    keep: impl FnMut(&Entry<'_>) -> bool,
) -> anyhow::Result<String> {
    may_write(to, force)?;
    let options = Options {
        compression: Some(Compression::Zstd),
        // A reader that does not know the layout needs the name of its program.
        written_by: reader.written_by().to_owned(),
        ..Options::default()
    };
    let mut file = LogFile::create_copy(to, options)?;
    let messages = copy(reader, file.writer(), keep)?;
    let size = bytes(finish(file, to)?);
    let mut text = format!("{}: {messages} messages, {size}\n", to.display());
    for damage in reader.damage() {
        text += &format!("  stepped over: {}\n", damage.first);
    }
    Ok(text)
}

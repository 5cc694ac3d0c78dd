//! `randt log check`: every byte and every checksum of a log.

use crate::exit::Outcome;
use crate::output::print;
use anyhow::Context;
use randt_log::{LogReader, check_sums};
use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Arguments of `randt log check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The logs
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

/// Checks all, and says of each whether it is good.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome::Good;
    for file in &arguments.files {
        let (messages, wrong) = check(file)?;
        let name = file.display();
        let mut text = String::new();
        // Writing to a String cannot fail.
        let _ = match wrong.as_slice() {
            [] => writeln!(text, "{name}: good, {messages} messages"),
            _ => writeln!(text, "{name}: damaged, {messages} messages can be read"),
        };
        for wrong in &wrong {
            outcome = Outcome::DataLost;
            let _ = writeln!(text, "  {wrong}");
        }
        print(&text)?;
    }
    Ok(outcome)
}

/// Messages that can be read, and what is wrong.
fn check(path: &Path) -> anyhow::Result<(u64, Vec<String>)> {
    let mut reader = LogReader::open(path)?;
    let (mut messages, mut wrong) = (0, Vec::new());
    while reader.next_entry()?.is_some() {
        messages += 1;
    }
    for damage in reader.damage() {
        let (count, kind) = (damage.count, damage.kind.name());
        wrong.push(format!("{count} {kind}: {}", damage.first));
    }
    let file = File::open(path).with_context(|| path.display().to_string())?;
    let sums = check_sums(BufReader::with_capacity(1 << 16, file));
    wrong.extend(sums.with_context(|| path.display().to_string())?);
    Ok((messages, wrong))
}

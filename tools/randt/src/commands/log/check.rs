//! `randt log check`: every byte and every checksum of a log, and what was not recorded.

use crate::exit::Outcome;
use crate::output::{json, print};
use anyhow::Context;
use randt_log::{LogReader, check_sums};
use randt_messages::{DropCause, LogDropTopic, health::text_of};
use serde::Serialize;
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
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Checks all, and prints for each whether it is good.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut all = Vec::new();
    for file in &arguments.files {
        let checked = check(file)?;
        // A large log takes a while: each is printed when it is read.
        if !arguments.json {
            print(&text(&checked))?;
        }
        all.push(checked);
    }
    if arguments.json {
        print(&json(&all)?)?;
    }
    let is_good = |it: &Checked| it.damaged.is_empty() && it.missing.is_empty();
    Ok(Outcome::finished(!all.iter().all(is_good)))
}

/// What a log is like.
#[derive(Default, Serialize)]
struct Checked {
    file: String,
    /// Messages that can be read.
    messages: u64,
    damaged: Vec<String>,
    /// What was not recorded.
    missing: Vec<String>,
}

/// For people. Writing to a String cannot fail.
fn text(checked: &Checked) -> String {
    let (name, messages) = (&checked.file, checked.messages);
    let mut text = String::new();
    let _ = match (checked.damaged.as_slice(), checked.missing.as_slice()) {
        ([], []) => writeln!(text, "{name}: good, {messages} messages"),
        ([], _) => writeln!(text, "{name}: whole, {messages} messages, but not all"),
        _ => writeln!(text, "{name}: damaged, {messages} messages can be read"),
    };
    for wrong in checked.damaged.iter().chain(&checked.missing) {
        let _ = writeln!(text, "  {wrong}");
    }
    text
}

fn check(path: &Path) -> anyhow::Result<Checked> {
    let mut reader = LogReader::open(path)?;
    let mut checked = Checked {
        file: path.display().to_string(),
        ..Checked::default()
    };
    while let Some(entry) = reader.next_entry()? {
        checked.messages += 1;
        if let Ok(Some(drop)) = entry.decode::<LogDropTopic>() {
            let (topic, cause) = (text_of(&drop.head.topic), drop.head.cause);
            let (count, cause) = (drop.head.count, DropCause::from_code(cause).name());
            checked
                .missing
                .push(format!("missing {count} of {topic}: {cause}"));
        }
    }
    for damage in reader.damage() {
        let (count, kind) = (damage.count, damage.kind.name());
        let text = format!("{count} {kind}: {}", damage.first);
        checked.damaged.push(text);
    }
    let file = File::open(path).with_context(|| path.display().to_string())?;
    let sums = check_sums(BufReader::with_capacity(1 << 16, file));
    let sums = sums.with_context(|| path.display().to_string())?;
    checked.damaged.extend(sums);
    Ok(checked)
}

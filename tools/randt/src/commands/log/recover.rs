//! `randt log recover`: a whole log of one that was cut.

use super::write_copy;
use crate::exit::Outcome;
use crate::output::print;
use randt_log::LogReader;
use std::path::{Path, PathBuf};

/// Arguments of `randt log recover`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The log, such as NAME.mcap.active; it stays as it is
    file: PathBuf,
    /// The new log; if not given, NAME.mcap for NAME.mcap.active, else NAME.recovered.mcap
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite it if it exists
    #[arg(long)]
    force: bool,
}

/// Writes anew what stands in whole chunks: only that has checksums.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| name_for(&arguments.file));
    print(&recover(&arguments.file, &out, arguments.force)?)?;
    Ok(Outcome::Good)
}

/// Does it; gives the text to print.
pub fn recover(file: &Path, out: &Path, force: bool) -> anyhow::Result<String> {
    let mut reader = LogReader::open(file)?;
    reader.whole_chunks_only();
    write_copy(&mut reader, out, force, |_| true)
}

fn name_for(file: &Path) -> PathBuf {
    if file.extension().is_some_and(|ending| ending == "active") {
        file.with_extension("")
    } else {
        file.with_extension("recovered.mcap")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_new_name_is_the_one_that_it_would_have_got() {
        let name = |file: &str| name_for(Path::new(file)).display().to_string();
        assert_eq!(name("a/2026.mcap.active"), "a/2026.mcap");
        assert_eq!(name("a/half.mcap"), "a/half.recovered.mcap");
    }
}

//! `randt log cut`: a span of a log as a log of its own.

use super::write_copy;
use crate::exit::Outcome;
use crate::output::print;
use randt_log::LogReader;
use std::path::PathBuf;

/// Arguments of `randt log cut`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The log
    file: PathBuf,
    /// The new log
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// First instant: seconds after the log's first message, or ns since 1970
    #[arg(long, value_name = "TIME", default_value = "0", value_parser = instant)]
    from: Instant,
    /// Last instant; if not given, the log's end
    #[arg(long, value_name = "TIME", value_parser = instant)]
    to: Option<Instant>,
    /// Overwrite the new log if it exists
    #[arg(long)]
    force: bool,
}

/// A time in a log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Instant {
    /// After the first message.
    AfterNs(i64),
    /// As messages are published.
    AtNs(i64),
}

/// Whole numbers from here on are ns since 1970: 1973, or 3 years into a log.
const NS_MIN: i64 = 100_000_000_000_000_000;

fn instant(text: &str) -> Result<Instant, String> {
    if let Ok(at_ns) = text.parse::<i64>()
        && at_ns >= NS_MIN
    {
        return Ok(Instant::AtNs(at_ns));
    }
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..1e8).contains(&seconds) => {
            Ok(Instant::AfterNs((seconds * 1e9).round() as i64))
        }
        _ => Err("expected seconds after the beginning, or ns since 1970".to_owned()),
    }
}

impl Instant {
    fn time_ns(self, begin_ns: i64) -> i64 {
        match self {
            Self::AfterNs(after_ns) => begin_ns.saturating_add(after_ns),
            Self::AtNs(at_ns) => at_ns,
        }
    }
}

/// Copies what lies in the span.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut reader = LogReader::open(&arguments.file)?;
    let begin_ns = reader.next_entry()?.map_or(0, |entry| entry.time_ns);
    let from_ns = arguments.from.time_ns(begin_ns);
    let to_ns = arguments.to.map_or(i64::MAX, |to| to.time_ns(begin_ns));
    if from_ns > to_ns {
        let why = "--from is after --to\n";
        clap::Error::raw(clap::error::ErrorKind::ValueValidation, why).exit();
    }
    let mut reader = LogReader::open(&arguments.file)?;
    let span = from_ns..=to_ns;
    let keep = |entry: &randt_log::Entry<'_>| span.contains(&entry.time_ns);
    let out = &arguments.out;
    print(&write_copy(&mut reader, out, arguments.force, keep)?)?;
    Ok(Outcome::finished(!reader.damage().is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds_or_stamps() {
        assert_eq!(instant("12.5"), Ok(Instant::AfterNs(12_500_000_000)));
        assert_eq!(instant("90"), Ok(Instant::AfterNs(90_000_000_000)));
        let stamp = 1_795_525_510_000_000_000;
        assert_eq!(instant(&stamp.to_string()), Ok(Instant::AtNs(stamp)));
        assert!(instant("-1").is_err() && instant("soon").is_err() && instant("1e9").is_err());
        assert_eq!(Instant::AfterNs(5).time_ns(10), 15);
    }
}

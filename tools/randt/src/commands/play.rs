//! `randt play`: publishes a log as the drivers would.

mod player;

use crate::exit::Outcome;
use crate::input::{InputOptions, number_within};
use player::Player;
use randt_stage::DomainArguments;
use std::path::PathBuf;

/// Arguments of `randt play`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A recording of any kind that `randt run` reads
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// How many times faster than it was recorded
    #[arg(long, value_name = "R", default_value = "1", value_parser = rate)]
    rate: f64,
    /// From the beginning again when it is at its end, until Ctrl-C; stamps go on rising
    #[arg(long = "loop")]
    endless: bool,
    /// Stay at the end, so that stages that start later find the last seconds; until Ctrl-C
    #[arg(long)]
    stay: bool,
    #[command(flatten)]
    domain: DomainArguments,
    /// End with this process, which has started this one
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
    #[command(flatten)]
    options: InputOptions,
}

/// Plays.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    // Before anything is published: a log that cannot be read disturbs nobody.
    let mut source = randt_readers::open(&arguments.log, &arguments.options.options())?;
    if let Some(parent) = arguments.parent {
        randt_stage::end_with(parent);
    }
    let mut player = Player::open(arguments.domain.domain()?, arguments.rate)?;
    while player.play(source.as_mut())? {
        if !arguments.endless {
            player.finish(arguments.stay)?;
            break;
        }
        source = randt_readers::open(&arguments.log, &arguments.options.options())?;
        player.begin_again();
    }
    let counters = source.counters();
    for counter in &counters {
        let (name, count, first) = (counter.name, counter.count, &counter.first);
        let log = arguments.log.display();
        eprintln!("{log}: {name} {count} (first: {first})");
    }
    player.close()?;
    let lost = counters.iter().any(|counter| counter.loss);
    Ok(Outcome::finished(lost))
}

/// A factor that a machine can keep up with.
pub fn rate(text: &str) -> Result<f64, String> {
    number_within(text, 0.01..=1000.0, "a factor between 0.01 and 1000")
}

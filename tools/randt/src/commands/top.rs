//! `randt top`: the running pipeline in tables.

mod facts;
mod feed;
mod screen;
mod snapshot;
mod stages;
mod table;
mod text;
mod traffic;
mod watch;

use crate::{exit::Outcome, input::number_within, output::print_value};
use anyhow::ensure;
use randt_stage::DomainArguments;
use screen::Screen;
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use watch::Watch;

/// How often what has come is taken: well before a buffer is full, however seldom the screen is
/// drawn.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// A single look takes this time: four or five words of every stage's health.
const ONCE: Duration = Duration::from_millis(2200);

/// Arguments of `randt top`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Watch for two seconds, print one table and end
    #[arg(long)]
    once: bool,
    /// Print JSON
    #[arg(long, requires = "once")]
    json: bool,
    /// Time between two screens, s
    #[arg(long, value_name = "S", default_value = "1", value_parser = interval)]
    interval: f64,
    #[command(flatten)]
    domain: DomainArguments,
}

/// Watches.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let watch = Watch::new(arguments.domain.domain()?);
    if arguments.once {
        once(watch, arguments.json)
    } else {
        live(watch, Duration::from_secs_f64(arguments.interval))
    }
}

fn once(mut watch: Watch, json: bool) -> anyhow::Result<Outcome> {
    let end = Instant::now() + ONCE;
    watch.refresh()?;
    while watch.is_connected() && Instant::now() < end {
        std::thread::sleep(POLL_PERIOD);
        watch.read();
    }
    let snapshot = watch.refresh()?;
    ensure!(
        !snapshot.stages.is_empty(),
        "no pipeline is there: no stage ever ran in {}; start one (randt up), or say where it is (--run, --prefix)",
        watch.domain().folder().display()
    );
    print_value(json, &snapshot, || text::plain(&snapshot))?;
    Ok(Outcome::Good)
}

fn live(mut watch: Watch, interval: Duration) -> anyhow::Result<Outcome> {
    ensure!(
        std::io::stdout().is_terminal(),
        "standard output is no terminal; --once prints a table"
    );
    // Before the terminal is taken: without the right to look there is a line that names the
    // reason.
    let mut snapshot = watch.refresh()?;
    let mut screen = Screen::open()?;
    let mut next = Instant::now() + interval;
    loop {
        if Instant::now() >= next {
            match watch.refresh() {
                Ok(now) => snapshot = now,
                // What was wrong for a moment is not seen at the next look.
                Err(error) => snapshot.notes = vec![format!("{error:#}")],
            }
            // From now, not from when it was due: a process that was stopped has nothing to make
            // up for.
            next = Instant::now() + interval;
        }
        screen.draw(&snapshot)?;
        // Until something is to be drawn: the end of the interval, a key, another size.
        loop {
            let left = next.saturating_duration_since(Instant::now());
            let asked = screen.wait(left.min(POLL_PERIOD))?;
            if asked == screen::Asked::End || randt_stage::stop_requested() {
                return Ok(Outcome::Good);
            }
            watch.read();
            if asked == screen::Asked::Draw || Instant::now() >= next {
                break;
            }
        }
    }
}

/// An interval that a person can follow.
fn interval(text: &str) -> Result<f64, String> {
    number_within(text, 0.1..=60.0, "a time between 0.1 and 60 seconds")
}

//! The benches: worlds, seeds and faults, against what was accepted last.

mod bounds;
mod cell;
mod figures;
mod map_errors;
mod plan;
mod record;
mod stretches;
mod summary;
mod table;
mod trust;
mod twin;

use randt::exit::Outcome;

/// Arguments of `randt-lab bench`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    bench: Bench,
}

#[derive(Debug, clap::Subcommand)]
enum Bench {
    /// Is it believed where it is wrong, and where it is right?
    ///
    /// Drives through worlds under faults, each with several seeds, and compares what odometry and
    /// mapper make of them with the truth (docs/trust-bench.md). Each finished drive is a line of
    /// the file, and is not computed again by the same program: a bench that was ended goes on.
    /// Exit code 3: a bound is broken, or a figure is worse by more than its spread.
    Trust(trust::Arguments),
}

/// Runs a bench.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    match arguments.bench {
        Bench::Trust(arguments) => trust::run(arguments),
    }
}

//! `randt bench`: what the parts of the method are worth.

mod ablation;
mod figures;
mod table;

use crate::exit::Outcome;

/// Arguments of `randt bench`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    bench: Bench,
}

#[derive(Debug, clap::Subcommand)]
enum Bench {
    /// Leave out one part of the method after the other and drive through the built-in worlds.
    ///
    /// Each drive is simulated in memory and computed seven times. With nothing else given this takes
    /// about a minute, at most three on a small machine, and half a gigabyte of memory; each further
    /// seed as long again. All figures but the times are the same in every run.
    Ablation(ablation::Arguments),
}

/// Measures.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    match arguments.bench {
        Bench::Ablation(arguments) => ablation::run(arguments),
    }
}

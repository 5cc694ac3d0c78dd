//! `randt layout`: the messages of the bus for programs that are not of this workspace.

mod bus_layout;
mod c;
mod python;
mod rust;

use crate::exit::Outcome;
use crate::output::print;
use bus_layout::BusLayout;

/// The language.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
pub struct Arguments {
    /// A Python module: numpy types, topics, and a class that reads the bus
    #[arg(long)]
    python: bool,
    /// A C header: structs, their sizes checked, the topics' names, and librandt_bus
    #[arg(long)]
    c: bool,
    /// A Rust module: `repr(C)` structs, their sizes checked, and the topics' names
    #[arg(long)]
    rust: bool,
}

/// The Python module: what the Python package reads the bus by.
pub fn python_module() -> anyhow::Result<String> {
    Ok(python::module(&BusLayout::of_this_build()?))
}

/// Prints the layout.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let layout = BusLayout::of_this_build()?;
    print(&if arguments.python {
        python::module(&layout)
    } else if arguments.c {
        c::header(&layout)
    } else if arguments.rust {
        rust::module(&layout)
    } else {
        layout.text()
    })?;
    Ok(Outcome::Good)
}

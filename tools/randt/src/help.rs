//! The first page of `--help`: the commands by what they serve.

use clap::{Command, Subcommand};

/// A task, and the commands that serve it.
pub type Group = (&'static str, &'static [&'static str]);

/// A template for clap in which the commands of `C` stand under their tasks.
pub fn template<C: Subcommand>(groups: &[Group]) -> String {
    let commands = C::augment_subcommands(Command::new(""));
    let lengths = commands.get_subcommands().map(|it| it.get_name().len());
    let width = lengths.max().unwrap_or_default();
    let mut text = "{about-with-newline}\n{usage-heading} {usage}\n".to_owned();
    for (task, names) in groups {
        text += &format!("\n{task}:\n");
        for command in names.iter().filter_map(|it| commands.find_subcommand(it)) {
            let about = command.get_about().cloned().unwrap_or_default();
            text += &format!("  {:<width$}  {about}\n", command.get_name());
        }
    }
    text + "\nOptions:\n{options}{after-help}"
}

/// Commands of `C` that are not in exactly one group, and names in groups that are no commands.
pub fn misplaced<C: Subcommand>(groups: &[Group]) -> Vec<String> {
    let commands = C::augment_subcommands(Command::new(""));
    let grouped = || groups.iter().flat_map(|(_, names)| names.iter().copied());
    let names = commands.get_subcommands().map(Command::get_name);
    let wrong = names.filter(|name| grouped().filter(|it| it == name).count() != 1);
    let unknown = grouped().filter(|name| commands.find_subcommand(name).is_none());
    wrong.chain(unknown).map(str::to_owned).collect()
}

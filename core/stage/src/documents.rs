//! A program's man pages and shell completions, made of the definitions that its options are
//! parsed by.
//!
//! Every program writes its own: the definitions stay in the mains, and the packaged pages
//! describe the options of the program that runs. The option is not clap's, because clap would
//! first require a subcommand, and because `--help` is for users of the program.

use crate::Error;
use clap::{Command, Parser};
use clap_complete::Shell;
use clap_complete::aot::Generator;
use randt_version::VERSION;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// `PROGRAM --documents DIR` writes them below DIR, in the folders that they have below
/// /usr/share.
const OPTION: &str = "--documents";
/// Where the shells search, in Debian's packages.
const SHELLS: [(Shell, &str); 3] = [
    (Shell::Bash, "bash-completion/completions"),
    (Shell::Zsh, "zsh/vendor-completions"),
    (Shell::Fish, "fish/vendor_completions.d"),
];
/// Commands are in section 1; stages, which are daemons, in 8.
const COMMANDS: &str = "1";
const DAEMONS: &str = "8";

/// Parses the command line, or writes its documents and ends.
pub fn parse<A: Parser>() -> A {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let command = A::command().version(VERSION);
    if let [_, option, folder] = arguments.as_slice()
        && option == OPTION
    {
        if let Err(error) = write(command, Path::new(folder)) {
            eprintln!("error: {error}");
            std::process::exit(1);
        }
        std::process::exit(0);
    }
    let parsed = A::from_arg_matches(&command.get_matches_from(arguments));
    parsed.unwrap_or_else(|error| error.format(&mut A::command()).exit())
}

/// Writes all of a program's documents below a folder.
fn write(command: Command, folder: &Path) -> Result<(), Error> {
    let name = command.get_name().to_owned();
    let mut completed = shown(&command).bin_name(&name);
    completed.build();
    for (shell, subfolder) in SHELLS {
        let mut text = Vec::new();
        shell.generate(&completed, &mut text);
        // clap_complete writes a program's hyphen in two ways for bash, so that options of its
        // commands are not found.
        let [two, one] = ["__subcmd__", "__"].map(|mark| name.replace('-', mark));
        let text = String::from_utf8_lossy(&text).replace(&two, &one);
        let file = match shell {
            // Every version of bash-completion finds this name.
            Shell::Bash => name.clone(),
            _ => shell.file_name(&name),
        };
        put(&folder.join(subfolder).join(file), text.as_bytes())?;
    }
    let mut command = command.disable_help_subcommand(true).bin_name(name);
    command.build();
    let section = match command.has_subcommands() {
        true => COMMANDS,
        false => DAEMONS,
    };
    write_pages(&command, section, &folder.join(format!("man/man{section}")))
}

/// A page for a command and for each one below it.
fn write_pages(command: &Command, section: &str, folder: &Path) -> Result<(), Error> {
    let page = clap_mangen::Man::new(command.clone())
        .section(section)
        // No date: the same source gives the same bytes.
        .source(format!("randt {VERSION}"));
    let path = folder.join(page.get_filename());
    let mut text = Vec::new();
    page.render(&mut text)
        .map_err(Error::file(&path, "cannot be made"))?;
    put(&path, &text)?;
    let below = command.get_subcommands();
    for command in below.filter(|command| !command.is_hide_set()) {
        write_pages(command, section, folder)?;
    }
    Ok(())
}

/// The same command without what `--help` does not show, which completions would offer.
fn shown(command: &Command) -> Command {
    let options = command.get_arguments().filter(|it| !it.is_hide_set());
    let below = command.get_subcommands().filter(|it| !it.is_hide_set());
    let copy = Command::new(command.get_name().to_owned())
        .about(command.get_about().cloned().unwrap_or_default())
        .args(options.cloned())
        .subcommands(below.map(shown));
    match command.get_version() {
        Some(version) => copy.version(version.to_owned()),
        None => copy,
    }
}

fn put(path: &Path, text: &[u8]) -> Result<(), Error> {
    let folder: PathBuf = path.parent().map(Path::to_owned).unwrap_or_default();
    fs::create_dir_all(&folder).map_err(Error::file(&folder, "cannot be made"))?;
    fs::write(path, text).map_err(Error::file(path, "cannot be written"))
}

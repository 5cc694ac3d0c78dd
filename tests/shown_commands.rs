//! Every command that a document shows is run by a test, or there is a reason why not; and every
//! option that a document names is there.

mod table;

use crate::support::package::{PROGRAMS, program};
use crate::support::{ended, pages, stages::beside};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use table::COMMANDS;

/// Who runs a command.
pub enum Runner {
    /// This test, in this form.
    Here(&'static str),
    /// Another test, a page that a test runs, or CI: the file, and the words that show it.
    File(&'static str, &'static str),
    /// Nobody, because.
    Nobody(&'static str),
}

/// Words that a command begins with.
const BEGIN: [&str; 13] = [
    "cargo", "pip", "python", "cc ", "./", ".ci/", "apt", "ssh", "cp ", "export ", "docker",
    "mdbook", "RUSTC_",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every command line in a block that no other test runs as it stands.
fn shown() -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for (name, text) in pages::all(&root()) {
        for block in pages::blocks(&text) {
            if !block.language.is_empty() {
                continue;
            }
            for line in block.text.lines() {
                let line = line.split("  #").next().unwrap().trim();
                let line = line.split(" # ").next().unwrap().trim();
                let line = line.strip_prefix("$ ").unwrap_or(line);
                let is_ours = line.split([' ', '-']).next() == Some("randt") && line.is_ascii();
                if is_ours || BEGIN.iter().any(|begin| line.starts_with(begin)) {
                    found.insert(line.to_owned(), name.clone());
                }
            }
        }
    }
    found
}

#[test]
fn every_command_that_a_document_shows_is_run_or_there_is_a_reason() {
    let shown = shown();
    let mut wrong = Vec::new();
    let listed: BTreeSet<&str> = COMMANDS.iter().map(|(command, _)| *command).collect();
    for (command, name) in &shown {
        if !listed.contains(command.as_str()) {
            wrong.push(format!(
                "{name}: {command}: who runs it? tests/shown_commands/table.rs"
            ));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let here = |command: &str| {
        let mut shell = Command::new("bash");
        let programs = program("randt");
        let path = std::env::var("PATH").unwrap();
        let programs = programs.parent().unwrap().display();
        shell
            .env("PATH", format!("{programs}:{path}"))
            .env("XDG_RUNTIME_DIR", folder.path());
        shell.current_dir(folder.path()).args(["-c", command]);
        ended(shell)
    };
    fs::write(
        folder.path().join("robot.toml"),
        "[robot]\nradar_x_m = 0.12\n",
    )
    .unwrap();
    let made = here("randt simulate building --scans 40 --seed 3 --out FILE");
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let mut counts = [0; 3];
    for (command, runner) in COMMANDS {
        if !shown.contains_key(*command) {
            wrong.push(format!("{command}: no document shows it any more"));
        }
        match runner {
            Runner::Here(form) => {
                counts[0] += 1;
                let ended = here(form);
                if ended.code != Some(0) {
                    wrong.push(format!("{form}: {:?} {}", ended.code, ended.stderr));
                }
            }
            Runner::File(file, words) => {
                counts[1] += 1;
                let text = fs::read_to_string(root().join(file)).unwrap();
                if !text.contains(words) {
                    wrong.push(format!("{command}: {file} has no {words:?}"));
                }
            }
            Runner::Nobody(reason) => {
                counts[2] += 1;
                println!("not run, {reason}: {command}");
            }
        }
    }
    println!("run here, elsewhere, not: {counts:?}");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Options and commands of `--help`, once for each.
#[derive(Default)]
struct Helps(BTreeMap<Vec<String>, String>);

impl Helps {
    fn text(&mut self, path: &[String]) -> &str {
        self.0.entry(path.to_vec()).or_insert_with(|| {
            let name = match path[0].as_str() {
                "randt-ros1" | "randt-ros2" | "randt-link" => beside(&path[0]),
                name => program(name),
            };
            let mut help = Command::new(name);
            help.args(&path[1..]).arg("--help");
            let ended = ended(help);
            match ended.code {
                Some(0) => ended.stdout,
                _ => String::new(),
            }
        })
    }
}

#[test]
fn every_option_that_a_document_names_is_there() {
    let mut helps = Helps::default();
    let mut wrong = Vec::new();
    let mut count = 0;
    for (name, text) in pages::all(&root()) {
        // What stands in backquotes, and the lines of blocks.
        let blocks = pages::blocks(&text).into_iter().map(|block| block.text);
        let lines: Vec<String> = blocks
            .flat_map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>())
            .collect();
        let inline = text.split('`').skip(1).step_by(2);
        let inline = inline
            .filter(|code| !code.contains('\n'))
            .map(str::to_owned);
        for code in lines.into_iter().chain(inline) {
            let code = code.split("  #").next().unwrap().replace("\\|", "|");
            let mut words = code
                .split_whitespace()
                .map(|word| word.trim_matches(['[', ']', ',', ';']));
            let Some(first) = words.next() else { continue };
            let known =
                PROGRAMS
                    .lines()
                    .chain(["randt-lab", "randt-link", "randt-ros1", "randt-ros2"]);
            if !known.into_iter().any(|program| program == first) {
                continue;
            }
            let mut path = vec![first.to_owned()];
            let mut within_commands = true;
            for word in words {
                let word = word.split('=').next().unwrap();
                let help = helps.text(&path).to_owned();
                let is_there = |word: &str| {
                    let mut lines = help.lines().map(str::trim_start);
                    lines.any(|line| line.split([' ', ',', '=']).any(|it| it == word))
                };
                if word.starts_with("--") && word.len() > 2 {
                    count += 1;
                    let options = word.split('|').filter(|word| word.starts_with("--"));
                    for option in options.filter(|option| !is_there(option)) {
                        wrong.push(format!(
                            "{name}: {code}: {option} is not in {path:?} --help"
                        ));
                    }
                } else if within_commands {
                    let word = word.split('|').next().unwrap();
                    let mut below = path.clone();
                    below.push(word.to_owned());
                    let is_command = word.chars().all(|c| c.is_ascii_lowercase() || c == '-');
                    if is_command && !helps.text(&below).is_empty() && is_there(word) {
                        path = below;
                    } else {
                        within_commands = false;
                    }
                }
            }
        }
    }
    println!("{count} options");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(count > 50, "{count}");
}

#[test]
fn the_book_has_every_page_and_no_other() {
    let docs = root().join("docs");
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let mut listed: Vec<&str> = summary
        .split("](")
        .skip(1)
        .map(|rest| rest.split(')').next().unwrap())
        .collect();
    listed.sort_unstable();
    let pages = crate::support::names(&docs);
    let mut pages: Vec<&str> = pages
        .iter()
        .map(String::as_str)
        .filter(|name| name.ends_with(".md") && *name != "SUMMARY.md")
        .collect();
    pages.sort_unstable();
    assert_eq!(listed, pages);
}

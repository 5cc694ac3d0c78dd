//! `--help`, man pages and completions of every program name the same options and commands.

use crate::support::ended;
use crate::support::package::{PROGRAMS, program};
use randt_simulator::World;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The one program that is not packaged.
const LAB: &str = "randt-lab";

type Names = BTreeSet<String>;

/// Long options in a text that are preceded by a mark.
fn options(text: &str, before: &str) -> Names {
    let found = text.split(before).skip(1);
    let names = found.map(|rest| {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
        rest.chars().take_while(|c| is_part(*c)).collect::<String>()
    });
    names.filter(|name| !name.is_empty()).collect()
}

fn first_word(text: &str) -> &str {
    text.split(' ').next().unwrap_or_default()
}

/// Options and commands of `--help`, which lists each on a line of its own.
fn helped(path: &[String]) -> (Names, Names) {
    let mut command = Command::new(program(&path[0]));
    command.args(&path[1..]).arg("--help");
    let said = ended(command);
    assert_eq!(said.code, Some(0), "{path:?}: {}", said.stderr);
    let is_option = |line: &&str| line.trim_start().starts_with('-') && line.starts_with("  ");
    let lines = said.stdout.lines().filter(is_option);
    // The option that a line begins with; what is said of it may name others.
    let listed = lines.filter_map(|line| line.split_once(" --"));
    let listed = listed.flat_map(|(_, rest)| options(&format!(" --{}", first_word(rest)), " --"));
    let mut commands = Names::new();
    let mut heading = "";
    for line in said.stdout.lines() {
        if !line.starts_with(' ') {
            heading = line;
        }
        // Commands stand under "Commands:" or under their tasks. What goes on from the line before
        // is indented further.
        if heading.ends_with(':') && !["Arguments:", "Examples:"].contains(&heading) {
            let name = line.strip_prefix("  ").map(first_word);
            let name = name.filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase()));
            commands.extend(name.map(String::from));
        }
    }
    commands.remove("help");
    (listed.collect(), commands)
}

/// The same of a man page.
fn on_page(share: &Path, path: &[String]) -> (Names, Names) {
    let name = path.join("-");
    let section = match path[0].as_str() {
        "randt" | LAB => 1,
        _ => 8,
    };
    let page = share.join(format!("man/man{section}/{name}.{section}"));
    let text = fs::read_to_string(&page).unwrap_or_else(|error| panic!("{page:?}: {error}"));
    assert!(text.contains("\n.SH NAME\n"), "{page:?}");
    // Of the options' own lines, not of what is said of them.
    let plain = text.replace("\\-", "-");
    let own = plain.lines().filter(|line| line.starts_with("\\fB-"));
    let listed = own.flat_map(|line| options(line, "\\fB--"));
    let below = format!("{name}-");
    let commands = plain.lines().filter_map(|line| {
        let (command, _) = line.split_once(&format!("({section})"))?;
        Some(
            command
                .trim_start_matches("\\fB")
                .strip_prefix(&below)?
                .to_owned(),
        )
    });
    (listed.collect(), commands.collect())
}

/// What bash offers behind some words for the beginning of the next one, by the completion's own
/// function.
fn offers(share: &Path, path: &[String], word: &str) -> Vec<String> {
    let file = share.join("bash-completion/completions").join(&path[0]);
    let words = path.join(" ");
    let count = path.len();
    let last = &path[count - 1];
    let script = format!(
        "source {}; of=$(complete -p {name}); of=${{of#*-F }}; COMP_WORDS=({words} '{word}'); COMP_CWORD={count}; \
         ${{of%% *}} {name} '{word}' {last}; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        file.display(),
        name = path[0],
    );
    let mut command = Command::new("bash");
    command.args(["-c", &script]);
    let said = ended(command);
    assert_eq!(said.stderr, "", "{path:?}");
    said.stdout.lines().map(str::to_owned).collect()
}

/// The same as bash offers it.
fn completed(share: &Path, path: &[String]) -> (Names, Names) {
    let listed = offers(share, path, "--");
    let listed = listed
        .iter()
        .flat_map(|word| options(&format!(" {word}"), " --"));
    let commands = offers(share, path, "").into_iter();
    // A world stands where commands have theirs.
    let is_world = |word: &String| World::NAMES.contains(&word.as_str());
    let commands = commands
        .filter(|word| !is_world(word))
        .filter(|word| word.starts_with(|c: char| c.is_ascii_lowercase()) && word != "help");
    (listed.collect(), commands.collect())
}

#[test]
fn help_man_pages_and_completions_agree() {
    let folder = tempfile::tempdir().unwrap();
    let share = folder.path();
    let mut paths: Vec<Vec<String>> = Vec::new();
    for name in PROGRAMS.lines().chain([LAB]) {
        let mut command = Command::new(program(name));
        command.arg("--documents").arg(share);
        let said = ended(command);
        assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{name}");
        paths.push(vec![name.to_owned()]);
        // Options of any command, and the commands themselves, as the other shells have them.
        for (file, mark) in [
            (format!("zsh/vendor-completions/_{name}"), "--"),
            (format!("fish/vendor_completions.d/{name}.fish"), "-l "),
        ] {
            let text = fs::read_to_string(share.join(&file)).unwrap();
            let (listed, commands) = helped(&[name.to_owned()]);
            let offered = options(&text, mark);
            assert!(listed.is_subset(&offered), "{file}: {listed:?} {offered:?}");
            assert!(!offered.contains("parent"), "{file} offers what is hidden");
            for command in commands {
                assert!(text.contains(&command), "{file}: {command}");
            }
        }
    }
    let mut count = 0;
    while let Some(path) = paths.pop() {
        let help = helped(&path);
        count += 1;
        if path == ["randt", "record"] {
            // It becomes the recorder, whose own documents have its options.
            let recorder = helped(&["randt-recorder".to_owned()]);
            assert_eq!(help, recorder);
            continue;
        }
        assert!(help.0.contains("help"), "{path:?}: {help:?}");
        assert_eq!(help, on_page(share, &path), "man {path:?}");
        assert_eq!(help, completed(share, &path), "bash {path:?}");
        paths.extend(help.1.iter().map(|name| {
            let mut below = path.clone();
            below.push(name.clone());
            below
        }));
    }
    let words = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
    let worlds = offers(share, &words("randt simulate"), "");
    assert!(
        World::NAMES
            .iter()
            .all(|name| worlds.iter().any(|it| it == name)),
        "{worlds:?}"
    );
    let profiles = offers(share, &words("randt run --profile"), "");
    assert_eq!(profiles, ["mixed", "indoor", "outdoor", "oxford"]);
    println!("{count} commands");
    let pages =
        ["man1", "man8"].map(|part| crate::support::names(&share.join("man").join(part)).len());
    assert_eq!(
        pages.iter().sum::<usize>(),
        count,
        "a page for each, and no other"
    );
}

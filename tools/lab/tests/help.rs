//! The program's first page, as a user reads it. That it is here makes `cargo test` build the
//! program, which the whole-program tests start.

#![allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]

use std::process::Command;

#[test]
fn the_first_page_groups_the_commands_and_has_examples() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_randt-lab"));
    let output = command.arg("--help").output().unwrap();
    assert!(output.status.success());
    let page = String::from_utf8(output.stdout).unwrap();
    for (task, _) in randt_lab::GROUPS {
        assert!(page.contains(&format!("\n{task}:\n")), "{page}");
    }
    let examples = page.split("Examples:\n").nth(1).unwrap();
    let examples = examples.lines().take_while(|line| !line.is_empty());
    assert!((3..=5).contains(&examples.count()), "{page}");
}

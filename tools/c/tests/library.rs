//! The library as a program in C has it. That it reads what stages write: tests/bus.rs.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use std::path::Path;
use std::process::Command;

#[test]
fn errors_come_back_with_their_reason() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    // Cargo builds it beside this program.
    let libraries = std::env::current_exe().unwrap();
    let libraries = libraries.parent().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("library");
    let mut compile = Command::new("cc");
    compile.args(["-std=c11", "-Wall", "-Werror", "-I"]);
    compile.arg(own.join("../randt/src/commands/layout"));
    compile.arg(own.join("tests/library.c")).arg("-L");
    compile.arg(libraries).args(["-lrandt_bus", "-o"]);
    assert!(compile.arg(&program).status().unwrap().success());
    let mut run = Command::new(&program);
    run.arg(folder.path()).env("LD_LIBRARY_PATH", libraries);
    let output = run.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
}

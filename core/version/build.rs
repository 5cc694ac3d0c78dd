//! Sets `RANDT_COMMIT` for the crate: from the environment where a package is built, else from
//! git.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=RANDT_COMMIT");
    let given = std::env::var("RANDT_COMMIT").unwrap_or_default();
    let commit = Some(given).filter(|commit| !commit.is_empty());
    let commit = commit.or_else(from_git);
    let commit = commit.unwrap_or_else(|| "unknown".to_owned());
    println!("cargo:rustc-env=RANDT_COMMIT={commit}");
}

/// The commit of the working tree. This runs again when `HEAD` moves, and not for every change of
/// a source file, which would compile all programs anew each time.
fn from_git() -> Option<String> {
    // The sources may lie unpacked in the folder of another repository.
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    // `HEAD` names the branch, its log grows with every commit.
    for file in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", file])?;
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    git(&["describe", "--always", "--dirty", "--exclude=*"])
}

/// What git prints; `None` where it is not there or fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

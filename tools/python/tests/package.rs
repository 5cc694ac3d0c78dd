//! The Python package as a user has it: its files beside the extension module, its tests run by
//! Python, its types checked by mypy.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the package and its tests need.
const PACKAGES: [&str; 2] = ["numpy==2.2.6", "mypy==1.18.2"];

/// Python with these packages; `None` where there is no network: a developer goes without, CI does
/// not.
fn python(root: &Path) -> Option<PathBuf> {
    let venv = root.join("target/python-package");
    let python = venv.join("bin/python");
    let imports = || {
        Command::new(&python)
            .args(["-c", "import numpy, mypy"])
            .output()
    };
    if imports().is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    let made = Command::new("python3")
        .args(["-m", "venv"])
        .arg(&venv)
        .output();
    let mut install = Command::new(&python);
    install
        .args(["-m", "pip", "install", "--quiet"])
        .args(PACKAGES);
    let installed = made.and_then(|_| install.output());
    let is_good = installed
        .as_ref()
        .is_ok_and(|output| output.status.success());
    let is_ci = std::env::var("CI").as_deref() == Ok("true");
    assert!(is_good || !is_ci, "{installed:?}");
    if !is_good {
        println!("skipped: {installed:?}");
    }
    is_good.then_some(python)
}

fn good(command: &mut Command) {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (printed, errors) = (text(&output.stdout), text(&output.stderr));
    println!("{printed}{errors}");
    assert!(output.status.success(), "{printed}{errors}");
}

#[test]
fn the_package_reads_computes_and_agrees_with_its_types() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let Some(python) = python(&own.join("../..")) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("randt");
    fs::create_dir(&package).unwrap();
    for entry in fs::read_dir(own.join("randt")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    // Cargo builds it beside this program.
    let built = std::env::current_exe()
        .unwrap()
        .with_file_name("lib_randt.so");
    std::os::unix::fs::symlink(built, package.join("_randt.abi3.so")).unwrap();

    let mut tests = Command::new(&python);
    tests.arg(own.join("tests/package.py")).current_dir(&folder);
    good(tests.env("PYTHONPATH", folder.path()));
    good(Command::new(&python).arg(own.join("tests/wheel.py")));
    let mut types = Command::new(&python);
    types.args(["-m", "mypy", "--strict", "--cache-dir", "cache", "randt"]);
    good(types.current_dir(&folder));
}

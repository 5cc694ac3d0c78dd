//! Python with the packages that read what we write: `mcap` and the official protobuf schemas for
//! logs, `iceoryx2` for the bus, in an environment of its own.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// What is installed, and what it is imported as.
const PACKAGES: &[&str] = &[
    "mcap==1.6.0",
    "mcap-protobuf-support==0.6.0",
    "foxglove-schemas-protobuf==0.4.0",
    "iceoryx2==0.10.0",
    "numpy==2.2.6",
];
const IMPORTS: &str = "import mcap, mcap_protobuf, foxglove_schemas_protobuf, iceoryx2, numpy";

/// A script of this folder, ready for its arguments; `None` as for [`program`].
pub fn script(name: &str) -> Option<Command> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/support");
    program(&folder.join(name))
}

/// A program in Python, ready for its arguments. `None` where there is no network: a developer goes
/// without, CI does not.
pub fn program(path: &Path) -> Option<Command> {
    static READY: OnceLock<bool> = OnceLock::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let venv = root.join("target/python-logs");
    let python = venv.join("bin/python");
    let is_ready = *READY.get_or_init(|| {
        let imports = || Command::new(&python).args(["-c", IMPORTS]).output();
        if imports().is_ok_and(|output| output.status.success()) {
            return true;
        }
        let mut make = Command::new("python3");
        let made = make.args(["-m", "venv"]).arg(&venv).output();
        let mut install = Command::new(&python);
        install
            .args(["-m", "pip", "install", "--quiet"])
            .args(PACKAGES);
        let installed = made.and_then(|_| install.output());
        let good = installed
            .as_ref()
            .is_ok_and(|output| output.status.success());
        assert!(
            good || std::env::var("CI").as_deref() != Ok("true"),
            "{installed:?}"
        );
        if !good {
            println!("skipped: {installed:?}");
        }
        good
    });
    is_ready.then(|| {
        let mut command = Command::new(&python);
        command.arg(path);
        command
    })
}

/// Runs it; it has to end well.
pub fn run(command: &mut Command) {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// Reads logs by Python's mcap package and the official protobuf schemas.
pub fn read_logs(files: &[PathBuf]) {
    if let Some(mut read) = script("read_logs.py") {
        run(read.args(files));
    }
}

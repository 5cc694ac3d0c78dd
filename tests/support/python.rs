//! Logs as Python reads them: by its mcap package and the official schemas, in an environment of its own.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Reads files by Python's mcap package and the official protobuf schemas.
pub fn read_logs(files: &[PathBuf]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let venv = root.join("target/python-logs");
    let python = venv.join("bin/python");
    let mut ready = Command::new(&python);
    ready.args([
        "-c",
        "import mcap, mcap_protobuf, foxglove_schemas_protobuf",
    ]);
    if !ready.output().is_ok_and(|output| output.status.success()) {
        // Where there is no network a developer goes without; CI does not.
        let made = Command::new("python3")
            .args(["-m", "venv"])
            .arg(&venv)
            .output();
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet", "mcap==1.6.0"]);
        install.args([
            "mcap-protobuf-support==0.6.0",
            "foxglove-schemas-protobuf==0.4.0",
        ]);
        let installed = made.and_then(|_| install.output());
        let good = installed
            .as_ref()
            .is_ok_and(|output| output.status.success());
        if !good && std::env::var("CI").as_deref() != Ok("true") {
            println!("skipped: {installed:?}");
            return;
        }
        assert!(good, "{installed:?}");
    }
    let mut read = Command::new(&python);
    read.arg(root.join("tests/support/read_logs.py"))
        .args(files);
    let output = read.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

//! Python with the packages that read what we write: for logs `mcap` with the official protobuf
//! schemas and with ROS 2's messages, and `rosbags`; for the bus `iceoryx2`, for what goes to a
//! flight controller `pymavlink`. In an environment of its own.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// What is installed, and what it is imported as.
const PACKAGES: &[&str] = &[
    "mcap==1.6.0",
    "mcap-ros2-support==0.6.0",
    "rosbags==0.11.9",
    "evo==1.38.1",
    "rerun-sdk==0.41.0",
    "mcap-protobuf-support==0.6.0",
    "foxglove-schemas-protobuf==0.4.0",
    "iceoryx2==0.10.0",
    "cyclonedds==11.0.1",
    "numpy==2.2.6",
    "pymavlink==2.4.50",
];
const IMPORTS: &str = "import mcap, mcap_protobuf, mcap_ros2, rosbags, foxglove_schemas_protobuf, \
                       iceoryx2, cyclonedds, numpy, pymavlink, evo, rerun";

/// A script of this folder, ready for its arguments; `None` as for [`program`].
pub fn script(name: &str) -> Option<Command> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/support");
    program(&folder.join(name))
}

/// A program in Python, ready for its arguments. `None` where there is no network: a developer
/// goes without, CI does not.
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

/// Reads exports for viewers by Python's mcap package and the official protobuf schemas.
pub fn read_logs(files: &[PathBuf]) {
    if let Some(mut read) = script("read_logs.py") {
        run(read.args(files));
    }
}

/// Reads logs and ROS bags by what reads ROS's messages in Python and, where there is `node`, in
/// Lichtblick. `tables`: those of the one log, as we export them.
pub fn read_ros2(files: &[PathBuf], tables: Option<&Path>) {
    let Some(mut read) = script("read_ros2.py") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let dump = folder.path().join("dump.json");
    read.args(files).arg("--dump").arg(&dump);
    if let Some(tables) = tables {
        read.arg("--tables").arg(tables);
    }
    run(&mut read);
    if let Some(mut read) = node("read_ros2.js") {
        run(read.arg(&dump));
    }
}

/// Reads logs by Rerun's importer.
pub fn read_rerun(files: &[PathBuf]) {
    if let Some(mut read) = script("read_rerun.py") {
        run(read.args(files));
    }
}

/// What Lichtblick 1.28 and Foxglove read ROS 2's messages by.
const NODE_PACKAGES: [&str; 6] = [
    "@lichtblick/rosmsg2-serialization@1.0.0",
    "@lichtblick/rosmsg@1.0.0",
    "@lichtblick/cdr@1.0.1",
    "@foxglove/rosmsg2-serialization@3.1.0",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/cdr@3.5.0",
];

/// A script of this folder for `node`; none where there is no npm or no network, which is said.
fn node(name: &str) -> Option<Command> {
    static READY: OnceLock<bool> = OnceLock::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let packages = root.join("target/node-logs");
    let is_ready = *READY.get_or_init(|| {
        if packages.join("node_modules/@foxglove/cdr").is_dir() {
            return true;
        }
        let mut install = Command::new("npm");
        install.args(["install", "--no-audit", "--no-fund", "--silent"]);
        // A registry that does not answer would else be asked for over a minute a package.
        install.args(["--fetch-retry-mintimeout=1000", "--fetch-timeout=30000"]);
        install.args(["--fetch-retry-maxtimeout=5000", "--prefix"]);
        let installed = install.arg(&packages).args(NODE_PACKAGES).output();
        let is_good = installed
            .as_ref()
            .is_ok_and(|output| output.status.success());
        if !is_good {
            println!("not read by Lichtblick's packages: {installed:?}");
        }
        is_good
    });
    if !is_ready {
        return None;
    }
    let mut command = Command::new("node");
    command.env("NODE_PATH", packages.join("node_modules"));
    command.arg(root.join("tests/support").join(name));
    Some(command)
}

//! The Debian package of a test: from the programs that are built already, or as good as others.

use super::stages;
use super::{ended, ended_within};
use randt_messages::{OdometryStateTopic, Topic};
use randt_stage::{Domain, Stage};
use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Names of the programs, a line each.
pub const PROGRAMS: &str = include_str!("../../systemd/package/programs");
/// Set where this program is an odometry of another build.
pub const OTHER_LAYOUT: &str = "RANDT_TEST_OTHER_LAYOUT";

/// Where one of them was built.
pub fn program(name: &str) -> PathBuf {
    match name.strip_prefix("randt-") {
        Some(stage) => stages::program(stage),
        None => Path::new(env!("CARGO_BIN_EXE_randt")).to_owned(),
    }
}

/// All programs in a folder. Those that are named are of another build: a byte longer.
pub fn collect(folder: &Path, name: &str, others: &[&str]) -> PathBuf {
    let to = folder.join(name);
    fs::create_dir(&to).unwrap();
    let programs = PROGRAMS.lines().map(|name| (name, program(name)));
    let library = ("librandt_bus.so", stages::beside("deps/librandt_bus.so"));
    for (name, built) in programs.chain([library]) {
        let path = to.join(name);
        // Without what only a debugger reads: a machine of a test lies in memory.
        let mut strip = Command::new("strip");
        strip.arg("--strip-debug").arg("-o").arg(&path).arg(built);
        assert_eq!(ended(strip).code, Some(0), "{name}");
        fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
        if others.contains(&name) {
            let mut file = fs::OpenOptions::new().append(true).open(&path).unwrap();
            file.write_all(b"\n").unwrap();
        }
    }
    to
}

/// Packages them.
pub fn build(programs: &Path, version: &str, out: &Path) -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../systemd/package/build");
    let mut command = Command::new(script);
    command
        .arg("--binaries")
        .arg(programs)
        .arg("--out")
        .arg(out);
    command.args(["--version", version, "--compress", "none"]);
    let output = ended_within(command, Duration::from_secs(120));
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    PathBuf::from(output.stdout.trim())
}

/// The states of a build in which, for example, a field has been added: their layout has another
/// name.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OtherStates;

impl Topic for OtherStates {
    const NAME: &'static str = OdometryStateTopic::NAME;
    const TYPE_NAME: &'static str = "OdometryStateTopic-0123456789abcdef";
    const MAX_ITEMS: usize = OdometryStateTopic::MAX_ITEMS;
    type Head = <OdometryStateTopic as Topic>::Head;
    type Item = <OdometryStateTopic as Topic>::Item;
}

/// What that build's odometry does: it begins as every stage does.
pub fn run_other_odometry() {
    let run = || -> Result<(), Box<dyn std::error::Error>> {
        let domain = Domain::new("randt", Some(Path::new("/run/randt")))?;
        let mut stage = Stage::open("odometry", &domain)?;
        let _states = stage.publisher::<OtherStates>()?;
        Ok(stage.running()?)
    };
    let code = randt_stage::ended("odometry", run());
    std::process::exit(i32::from(format!("{code:?}").contains('1')));
}

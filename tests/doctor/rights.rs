//! Domains whose folders and files belong to others, or are open to them.

use super::{assert_bad, assert_line};
use crate::support::pipeline::Pipeline;
use crate::support::{ended, randt};
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

#[test]
fn another_users_domain_is_reported_with_its_owner() {
    if !rustix::process::geteuid().is_root() {
        // A folder that is surely there and not this user's.
        let other = ended(randt(&["doctor", "--run", "/", "--prefix", "usr"]));
        assert_bad(&other, "belongs to user 0", "sudo -u '#0' randt doctor");
        return;
    }
    // Root inspects and cleans with the rights of its owner.
    let pipeline = Pipeline::new("whose");
    pipeline.domain().make().unwrap();
    let domain = pipeline.domain();
    for folder in [
        domain.run(),
        &domain.folder(),
        &domain.root(),
        &domain.state(),
    ] {
        std::os::unix::fs::chown(folder, Some(65534), None).unwrap();
    }
    let other = pipeline.randt(&["doctor"]);
    assert_eq!(other.code, Some(0), "{}{}", other.stdout, other.stderr);
    assert_line(&other, "ok", "this process are user 65534");
    let clean = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(clean.code, Some(0), "{}", clean.stderr);
}

#[test]
fn a_file_that_others_may_write_to_is_found_and_closed() {
    let mut pipeline = Pipeline::new("open");
    pipeline.stage("filter");
    let count = pipeline.segments().into_iter();
    let mut count = count.filter(|name| name.ends_with("global_mgmt"));
    let count = Path::new("/dev/shm").join(count.next().unwrap());
    let mode = || fs::metadata(&count).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(), 0o600, "whatever iceoryx2 makes of it");
    fs::set_permissions(&count, Permissions::from_mode(0o666)).unwrap();
    assert_bad(
        &pipeline.randt(&["doctor"]),
        "1 file that other users may read or write, such as /dev/shm/open-",
        "randt doctor --clean --prefix open-",
    );
    let clean = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(clean.code, Some(0), "{}", clean.stderr);
    assert_eq!(mode(), 0o600);
    assert_line(&pipeline.randt(&["doctor"]), "ok", "for their owner alone");
}

#[test]
fn the_run_folder_is_the_sessions_where_that_is_the_users_alone() {
    if Path::new("/run/randt").is_dir() {
        return println!("not run: this machine has /run/randt");
    }
    let session = tempfile::tempdir().unwrap();
    let title = |runtime: &str| {
        let mut doctor = randt(&["doctor", "--prefix", "session"]);
        doctor.env("XDG_RUNTIME_DIR", runtime);
        let output = ended(doctor).stdout;
        output.lines().next().unwrap().to_owned()
    };
    let path = session.path().to_str().unwrap();
    fs::set_permissions(path, Permissions::from_mode(0o700)).unwrap();
    assert_eq!(title(path), format!("domain session in {path}/randt"));
    let usual = title("");
    assert!(!usual.contains(path), "{usual}");
    // What others may look into is no session's, nor is what is not there, or no absolute path.
    fs::set_permissions(path, Permissions::from_mode(0o755)).unwrap();
    for other in [path, "/nowhere", "."] {
        assert_eq!(title(other), usual, "{other}");
    }
}

#[test]
fn a_domain_that_this_user_may_not_read_is_reported_with_its_owner() {
    if !rustix::process::geteuid().is_root() {
        // Only root can become somebody else.
        assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
        println!("not run: this user is not root");
        return;
    }
    let mut pipeline = Pipeline::new("hidden");
    pipeline.stage("filter");
    // A copy that anybody may run, wherever this program lies.
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
    let program = folder.path().join("randt");
    // By another process: while this one has it open for writing, any other thread's child does.
    let mut cp = Command::new("cp");
    cp.arg(env!("CARGO_BIN_EXE_randt")).arg(&program);
    assert!(cp.status().unwrap().success());
    let as_nobody = |words: &[&str]| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]);
        command.arg(&program).args(words);
        let domain = pipeline.domain();
        command.args(["--prefix", domain.prefix(), "--run"]);
        command.arg(domain.run());
        ended(command)
    };
    assert_bad(
        &as_nobody(&["doctor"]),
        "belongs to user 0, this process is user 65534",
        "sudo -u '#0' randt doctor",
    );
    let top = as_nobody(&["top", "--once"]);
    assert_eq!(top.code, Some(1));
    assert!(top.stderr_contains("belongs to user 0"), "{}", top.stderr);
}

#[test]
fn rights_that_are_too_wide_are_bad() {
    let pipeline = Pipeline::new("rights");
    pipeline.domain().make().unwrap();
    let folder = pipeline.domain().folder();
    let fix = format!("chmod 700 {}", folder.display());
    fs::set_permissions(&folder, Permissions::from_mode(0o777)).unwrap();
    assert_bad(&pipeline.randt(&["doctor"]), "others may write in it", &fix);
    fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
    let looks = pipeline.randt(&["doctor"]);
    assert_line(&looks, "WARN", "others may look into it");
    assert_eq!(looks.code, Some(0));
}

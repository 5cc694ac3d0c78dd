//! All stages of a pipeline run as one user; another one is told so.

use crate::support::{command, told};
use randt_stage::{Error, Realm, Stage};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// The user that every system has for those who may do nothing.
const NOBODY: u32 = 65534;

/// What the other user does: it starts a stage.
#[test]
fn other_user() {
    let Some(run) = told() else {
        return;
    };
    match Stage::open("filter", &Realm::new("user", Some(&run)).unwrap()) {
        Ok(_) => println!("it starts"),
        Err(error @ Error::OtherUser { .. }) => println!("refused: {error}"),
        Err(error) => println!("another error: {error}"),
    }
}

#[test]
fn another_user_is_refused_and_told_whose_pipeline_it_is() {
    if !rustix::process::geteuid().is_root() {
        // Only root can become somebody else.
        assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
        println!("not run: this user is not root");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    // A copy that anybody may run, wherever this program lies.
    let program = folder.path().join("program");
    fs::copy(std::env::current_exe().unwrap(), &program).unwrap();

    // The run folder is the first user's own.
    let private = folder.path().join("private");
    let realm = Realm::new("user", Some(&private)).unwrap();
    let stage = Stage::open("mapper", &realm).unwrap();
    assert_refused(&program, &private, &private);
    drop(stage);
    assert_refused(&program, &private, &private);

    // One that anybody may look into, as a service manager makes it for its user.
    let open = folder.path().join("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o755)).unwrap();
    assert_refused(&program, &open, &open);

    // One that anybody may write to: the pipeline in it is still the first user's.
    let shared = folder.path().join("shared");
    fs::create_dir(&shared).unwrap();
    fs::set_permissions(&shared, fs::Permissions::from_mode(0o1777)).unwrap();
    let realm = Realm::new("user", Some(&shared)).unwrap();
    let _stage = Stage::open("mapper", &realm).unwrap();
    assert_refused(&program, &shared, &realm.folder());
}

fn assert_refused(program: &Path, run: &Path, owned: &Path) {
    let other = command(program, "user::other_user", run);
    let mut sudo = Command::new("setpriv");
    let id = NOBODY.to_string();
    sudo.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
    sudo.arg(other.get_program()).args(other.get_args());
    sudo.envs(
        other
            .get_envs()
            .filter_map(|(key, value)| Some((key, value?))),
    );
    let ended = sudo.output().unwrap();
    let said = String::from_utf8_lossy(&ended.stdout);
    println!("{said}");
    let expected = format!(
        "refused: {}: belongs to user 0, this process is user {NOBODY}: all stages must run as one user",
        owned.display()
    );
    assert!(said.contains(&expected), "{expected}\nis not in: {said}");
}

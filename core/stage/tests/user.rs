//! All stages of a pipeline run as one user; another one is refused with an error that explains
//! it.

use crate::support::{command_as, pipeline_folder, program_for_all};
use randt_stage::{Domain, Error, Stage};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// The user without rights that every system has.
const NOBODY: u32 = 65534;

/// What the other user does: it starts a stage.
#[test]
fn other_user() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    match Stage::open("filter", &Domain::new("user", Some(&run)).unwrap()) {
        Ok(_) => println!("it starts"),
        Err(error @ Error::OtherUser { .. }) => println!("refused: {error}"),
        Err(error) => println!("another error: {error}"),
    }
}

#[test]
fn another_user_is_refused_and_the_owner_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = program_for_all(folder.path()) else {
        return;
    };

    // The run folder is the first user's own.
    let private = folder.path().join("private");
    let domain = Domain::new("user", Some(&private)).unwrap();
    let stage = Stage::open("mapper", &domain).unwrap();
    assert_refused(&program, &private, &private);
    drop(stage);
    assert_refused(&program, &private, &private);

    // One that all users may read, as a service manager makes it for its user.
    let open = folder.path().join("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o755)).unwrap();
    assert_refused(&program, &open, &open);

    // One that all users may write to is refused to its owner, too.
    let shared = folder.path().join("shared");
    fs::create_dir(&shared).unwrap();
    fs::set_permissions(&shared, fs::Permissions::from_mode(0o1777)).unwrap();
    let domain = Domain::new("user", Some(&shared)).unwrap();
    let error = Stage::open("mapper", &domain).err().unwrap().to_string();
    assert!(
        error.contains("shared: mode 1777: other users may"),
        "{error}"
    );
}

fn assert_refused(program: &Path, run: &Path, owned: &Path) {
    let mut other = command_as(NOBODY, program, "user::other_user", run);
    let ended = other.output().unwrap();
    let output = String::from_utf8_lossy(&ended.stdout);
    println!("{output}");
    let expected = format!(
        "refused: {}: belongs to user 0, this process is user {NOBODY}: all stages must run as one user",
        owned.display()
    );
    assert!(
        output.contains(&expected),
        "{expected}\nis not in: {output}{}, {}",
        ended.status,
        String::from_utf8_lossy(&ended.stderr)
    );
}

//! What another user of the machine can do to a pipeline before and while it runs: nothing, or a
//! start ends at once with an error.

use crate::support::{command, command_as, pipeline_folder, program_for_all};
use randt_stage::{Domain, Registry, Stage, exposed};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use std::fs::{self, File, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, lchown, symlink};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The pipeline's user, and another one.
const USER: u32 = 65534;
const STRANGER: u32 = 65533;
const PREFIX: &str = "stranger";
/// A start takes less than a second. Before, it waited for ever.
const START_MAX: Duration = Duration::from_secs(60);

/// What the pipeline's user does: it starts a stage.
#[test]
fn starts() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    match Stage::open("filter", &Domain::new(PREFIX, Some(&run)).unwrap()) {
        Ok(_) => println!("it starts"),
        Err(error) => println!("refused: {error}"),
    }
}

/// Clears away what dead stages have left, which no process in the domain can do.
#[test]
fn cleans() {
    if let Some(folder) = pipeline_folder() {
        let [run, prefix] = [
            folder.parent().unwrap(),
            Path::new(folder.file_name().unwrap()),
        ];
        let domain = Domain::new(prefix.to_str().unwrap(), Some(run)).unwrap();
        randt_stage::clean_up(&domain).unwrap();
    }
}

fn clean(domain: &Domain) {
    let program = std::env::current_exe().unwrap();
    let mut other = command(&program, "strangers::cleans", &domain.folder());
    assert!(other.status().unwrap().success());
}

/// The output of a start as the pipeline's user, who must not have to wait.
fn start(program: &Path, run: &Path) -> String {
    let output = run.parent().unwrap().join("output");
    let mut command = command_as(USER, program, "strangers::starts", run);
    command.stdout(File::create(&output).unwrap());
    let mut child = command.spawn().unwrap();
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > START_MAX {
            child.kill().unwrap();
            panic!("it hangs");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = fs::read_to_string(output).unwrap();
    let status = child.wait().unwrap();
    format!("{output}{status}, {:.2} s", begin.elapsed().as_secs_f64())
}

/// A run folder of the pipeline's user below a folder that all users may read.
fn run_folder(folder: &Path) -> PathBuf {
    let run = folder.join("run");
    fs::create_dir(&run).unwrap();
    chown(&run, Some(USER), Some(USER)).unwrap();
    run
}

/// Where the count of nodes of a pipeline is. Anybody knows that name beforehand.
fn node_count(run: &Path) -> PathBuf {
    let prefix = Domain::new(PREFIX, Some(run)).unwrap().segment_prefix();
    let name = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
    Path::new("/dev/shm").join(format!("{prefix}{name}"))
}

#[test]
fn memory_that_a_stranger_made_ends_a_start_with_words() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = program_for_all(folder.path()) else {
        return;
    };
    let run = run_folder(folder.path());
    let path = node_count(&run);
    let whole = [0_u8, 0, 10, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
    for what in ["empty", "whole", "pipe", "link"] {
        match what {
            "empty" => fs::write(&path, []).unwrap(),
            "whole" => fs::write(&path, whole).unwrap(),
            "pipe" => {
                let mode = Mode::from_raw_mode(0o666);
                mknodat(CWD, &path, FileType::Fifo, mode, 0).unwrap();
            }
            _ => symlink(folder.path().join("program"), &path).unwrap(),
        }
        lchown(&path, Some(STRANGER), Some(STRANGER)).unwrap();
        if what != "link" {
            fs::set_permissions(&path, Permissions::from_mode(0o666)).unwrap();
        }
        let output = start(&program, &run);
        let expected = format!("{}: belongs to user {STRANGER}", path.display());
        assert!(output.contains(&expected), "{what}: {output}");
        fs::remove_file(&path).unwrap();
    }
    let output = start(&program, &run);
    assert!(output.contains("it starts"), "{output}");

    // Root takes it away.
    fs::write(&path, []).unwrap();
    chown(&path, Some(STRANGER), Some(STRANGER)).unwrap();
    fs::remove_dir_all(&run).unwrap();
    fs::create_dir(&run).unwrap();
    let domain = Domain::new(PREFIX, Some(&run)).unwrap();
    drop(Stage::open("filter", &domain).unwrap());
    assert_eq!(fs::metadata(&path).unwrap().uid(), 0);
    fs::remove_file(path).unwrap();
}

#[test]
fn a_stranger_can_neither_read_nor_write_what_stages_share() {
    let folder = tempfile::tempdir().unwrap();
    let Some(_) = program_for_all(folder.path()) else {
        return;
    };
    let run = tempfile::tempdir().unwrap();
    let domain = Domain::new("shared", Some(run.path())).unwrap();
    let stage = Stage::open("filter", &domain).unwrap();
    assert_eq!(exposed(&domain), [], "memory, sockets, locks, register");
    let prefix = domain.segment_prefix();
    let mut script = String::new();
    for verb in ["truncate -s 0", "cat", "rm -f", "chmod 777", "mv -t /tmp"] {
        script += &format!("for f in /dev/shm/{prefix}*; do {verb} $f && echo did {verb}; done\n");
    }
    let mut command = std::process::Command::new("setpriv");
    let id = STRANGER.to_string();
    command.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
    let ended = command.args(["sh", "-c", &script]).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&ended.stdout), "");

    // Rights that were given to others are taken away by the next start, and listed until then.
    let count = crate::support::segment(&domain, "global_mgmt");
    fs::set_permissions(&count, Permissions::from_mode(0o666)).unwrap();
    let lock = domain.folder().join("entry.lock");
    fs::set_permissions(&lock, Permissions::from_mode(0o644)).unwrap();
    let listed: Vec<PathBuf> = exposed(&domain).into_iter().map(|file| file.path).collect();
    assert_eq!(listed, [count, lock]);
    clean(&domain);
    assert_eq!(exposed(&domain), []);
    drop(stage);
}

#[test]
fn segments_that_a_stranger_plants_beside_the_stages_do_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let Some(_) = program_for_all(folder.path()) else {
        return;
    };
    let run = tempfile::tempdir().unwrap();
    let domain = Domain::new("plants", Some(run.path())).unwrap();
    let stage = Stage::open("filter", &domain).unwrap();
    let shared = crate::support::segment(&domain, "dynamic");
    let name = shared.file_name().unwrap().to_str().unwrap();
    let (_, number) = name.rsplit_once('_').unwrap();
    // One that claims to be the segment of a service in use, and one that claims nothing.
    let planted = [format!("zz_{number}"), "zz".to_owned()]
        .map(|name| PathBuf::from(format!("/dev/shm/{}{name}", domain.segment_prefix())));
    for path in &planted {
        fs::write(path, []).unwrap();
        chown(path, Some(STRANGER), Some(STRANGER)).unwrap();
    }
    clean(&domain);
    assert!(shared.exists(), "a segment in use was removed");
    assert!(Registry::all(&domain).iter().all(|(_, lives)| *lives));
    assert_eq!(exposed(&domain).len(), planted.len(), "they are listed");
    drop(stage);
    planted
        .iter()
        .for_each(|path| fs::remove_file(path).unwrap());
}

#[test]
fn a_run_folder_of_a_stranger_is_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let Some(_) = program_for_all(folder.path()) else {
        return;
    };
    let path = |name: &str| folder.path().join(name);
    let strangers = |name: &str| lchown(path(name), Some(STRANGER), Some(STRANGER)).unwrap();
    let victim = path("victim");
    fs::create_dir(&victim).unwrap();
    let refused = |run: &Path, expected: &str| {
        let domain = Domain::new(PREFIX, Some(run)).unwrap();
        for error in [
            Stage::open("filter", &domain).err().unwrap(),
            randt_stage::wipe(&domain, true).unwrap_err(),
            domain.check_owner().unwrap_err(),
        ] {
            assert!(error.to_string().contains(expected), "{error}");
        }
        assert_eq!(fs::read_dir(&victim).unwrap().count(), 0);
    };
    let owned = format!("belongs to user {STRANGER}");
    // Made beforehand, with a domain of this user's in it: its owner may put another one there.
    fs::create_dir(path("run")).unwrap();
    Domain::new(PREFIX, Some(&path("run")))
        .unwrap()
        .make()
        .unwrap();
    strangers("run");
    refused(&path("run"), &owned);
    // A link in a folder that all users may write to.
    fs::create_dir(path("all")).unwrap();
    fs::set_permissions(path("all"), Permissions::from_mode(0o1777)).unwrap();
    symlink(&victim, path("all/run")).unwrap();
    strangers("all/run");
    refused(&path("all/run"), &owned);
    refused(&path("all/run/below"), &owned);
    // One of this user's is no run folder either.
    symlink(&victim, path("own")).unwrap();
    refused(&path("own"), "is no folder, or cannot be opened");
    // Below a folder of a stranger's.
    fs::create_dir_all(path("theirs/deep/run")).unwrap();
    strangers("theirs");
    refused(&path("theirs/deep/run"), &owned);
    // A domain that is a link, and one that is another's.
    fs::create_dir(path("mine")).unwrap();
    symlink(&victim, path("mine").join(PREFIX)).unwrap();
    refused(&path("mine"), "is no folder, or cannot be opened");
    fs::remove_file(path("mine").join(PREFIX)).unwrap();
    fs::create_dir(path("mine").join(PREFIX)).unwrap();
    strangers(&format!("mine/{PREFIX}"));
    refused(&path("mine"), &owned);
}

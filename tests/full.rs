//! Shared memory that is too small: a stage ends with a clear error before it begins, and none is
//! killed by a store.

use crate::support::stages::{RunFolder, Running};
use crate::support::{Ended, drive, ended_within};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Tells this program that it runs in the small world, and where the log is.
const LOG: &str = "RANDT_TEST_LOG";
/// From what holds nothing to what holds everything.
const SIZES_KB: [u32; 10] = [
    40, 200, 600, 1_000, 2_000, 4_000, 8_000, 12_000, 24_000, 64_000,
];
/// Whole seconds of scans, so that the histories of the largest topics are full.
const SCANS: u64 = 40;

#[test]
fn too_little_shared_memory_is_an_error_and_never_a_signal() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&drive::events(SCANS), &log);
    if !Command::new("unshare")
        .args(["-m", "true"])
        .status()
        .is_ok_and(|s| s.success())
    {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI may make its own mounts"
        );
        println!("not run: this user may not make its own mounts");
        return;
    }
    // Each has a shared memory of its own, so that they run side by side.
    let log = &log;
    let sizes: Vec<_> = std::thread::scope(|scope| {
        let running = SIZES_KB.map(|size| (size, scope.spawn(move || in_memory_of(size, log))));
        running
            .into_iter()
            .map(|(size, running)| (size, running.join().unwrap()))
            .collect()
    });
    let (mut refused, mut ran) = (0, 0);
    for (size, ended) in sizes {
        let rows: Vec<&str> = ended
            .stdout
            .lines()
            .filter(|l| l.starts_with("| "))
            .collect();
        println!("{size} kB\n{}", rows.join("\n"));
        assert_eq!(
            ended.code,
            Some(0),
            "{size} kB: {}{}",
            ended.stdout,
            ended.stderr
        );
        refused += rows.iter().filter(|row| row.contains("MB free")).count();
        ran += usize::from(rows.iter().all(|row| row.contains("ran")));
    }
    assert!(refused > 0 && ran > 0, "sizes on both sides");
}

/// This program once more, with that much shared memory.
fn in_memory_of(size: u32, log: &Path) -> Ended {
    let script = format!("mount -t tmpfs -o size={size}k tmpfs /dev/shm && exec \"$0\" \"$@\"");
    let mut command = Command::new("unshare");
    command.args(["-m", "sh", "-c", &script]);
    command.arg(std::env::current_exe().unwrap());
    command.args(["full::in_the_small_world", "--exact", "--nocapture"]);
    command.env(LOG, log);
    ended_within(command, Duration::from_secs(90))
}

#[test]
fn in_the_small_world() {
    let Some(log) = std::env::var_os(LOG).map(PathBuf::from) else {
        return;
    };
    let folder = RunFolder::new();
    let (profile, _) = folder.profile(&log);
    for order in [
        ["mapper", "odometry", "filter", "play"],
        ["play", "filter", "odometry", "mapper"],
    ] {
        let domain = folder.domain(order[0]);
        let mut programs = order.map(|name| {
            let mut command = RunFolder::command(&domain, name);
            match name {
                "play" => command.args(["--stay", "--rate", "4"]).arg(&log),
                _ => command.arg("--profile").arg(&profile),
            };
            let program = folder.start(name, command);
            std::thread::sleep(Duration::from_millis(300));
            program
        });
        std::thread::sleep(Duration::from_secs(SCANS / 5 / 4 + 1));
        programs.iter_mut().for_each(|program| check(program, &log));
        assert!(randt_stage::wipe(&domain, true).unwrap().is_some());
    }
}

/// It ran, or it has written how much is free, how much it needs, and what to do.
fn check(program: &mut Running, log: &Path) {
    let ended_early = program.ended().is_some();
    let status = program.stop();
    let output = program.stderr();
    let name = &program.name;
    let last = output.lines().last().unwrap_or_default();
    assert_eq!(
        status.signal(),
        None,
        "randt-{name} on {}: {status}: {output}",
        log.display()
    );
    if !ended_early && status.success() {
        println!("| {name:<9} ran");
        return;
    }
    println!("| {name:<9} {last}");
    assert_eq!(status.code(), Some(1), "randt-{name}: {output}");
    for part in ["MB free", "needs", "mount -o remount,size="] {
        assert!(last.contains(part), "randt-{name}: {output}");
    }
}

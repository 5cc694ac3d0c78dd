//! A machine of our own for a test: systemd as the first process of new namespaces (`boot.sh`),
//! with our units and programs on it.

use super::stages::program;
use super::{Ended, ended};
use std::fs::{self, File};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Nothing is waited for longer.
const WAIT_MAX: Duration = Duration::from_secs(120);
/// What the machine boots into.
const TARGET: &str = "test.target";
/// Where packages put what is systemd's, by the folders of `systemd/`.
const PLACES: [(&str, &str); 5] = [
    ("sysusers.d", "usr/lib/sysusers.d"),
    ("tmpfiles.d", "usr/lib/tmpfiles.d"),
    ("sysctl.d", "usr/lib/sysctl.d"),
    ("modules-load.d", "usr/lib/modules-load.d"),
    ("udev", "usr/lib/udev/rules.d"),
];

/// The folder of the units.
pub fn units_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../systemd")
}

/// Files of a machine that is going to be booted, over this one's.
pub struct Image {
    folder: TempDir,
}

/// A machine that runs; it goes with this.
pub struct Machine {
    unshare: Child,
    /// Its first process, by this machine's number.
    init: u32,
    _image: Image,
}

impl Image {
    /// Nothing that is not on this machine.
    pub fn bare() -> Self {
        let folder = tempfile::tempdir().unwrap();
        // It becomes the machine's root.
        open_to_all(folder.path());
        let image = Self { folder };
        for name in ["disk", "root", "files"] {
            fs::create_dir(image.folder.path().join(name)).unwrap();
        }
        open_to_all(&image.file(""));
        let target = "[Unit]\nRequires=basic.target\nAfter=basic.target\nAllowIsolate=yes\n";
        image.write(&format!("etc/systemd/system/{TARGET}"), target);
        image
    }

    /// Programs and units in place, nothing enabled.
    pub fn new(stages: &[&str]) -> Self {
        let image = Self::bare();
        image.program(Path::new(env!("CARGO_BIN_EXE_randt")), "randt");
        for stage in stages {
            image.program(&program(stage), &format!("randt-{stage}"));
        }
        for entry in fs::read_dir(units_folder()).unwrap().flatten() {
            let name = entry.file_name().into_string().unwrap();
            if [".service", ".target", ".slice"]
                .iter()
                .any(|end| name.ends_with(end))
            {
                let text = fs::read_to_string(entry.path()).unwrap();
                image.write(&format!("usr/lib/systemd/system/{name}"), &text);
            }
        }
        for (from, to) in PLACES {
            for entry in fs::read_dir(units_folder().join(from)).unwrap().flatten() {
                let name = entry.file_name().into_string().unwrap();
                let text = fs::read_to_string(entry.path()).unwrap();
                image.write(&format!("{to}/{name}"), &text);
            }
        }
        image
    }

    /// A file of the machine.
    pub fn file(&self, path: &str) -> PathBuf {
        self.folder.path().join("files").join(path)
    }

    /// Writes one.
    pub fn write(&self, path: &str, text: &str) {
        let path = self.file(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
    }

    /// Puts a program, or anything large, there. A link where that can be, which is copied as the
    /// machine boots.
    pub fn program(&self, from: &Path, name: &str) {
        let to = self.file("usr/bin").join(name);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        if fs::hard_link(from, &to).is_err() {
            fs::copy(from, &to).unwrap();
        }
    }

    /// Enables a unit, as `systemctl enable` does; what wants randt.target is this machine's own.
    pub fn enable(&self, unit: &str, by: &str) {
        let by = self.file(&format!("etc/systemd/system/{by}.wants"));
        fs::create_dir_all(&by).unwrap();
        symlink(format!("/usr/lib/systemd/system/{unit}"), by.join(unit)).unwrap();
    }

    /// The whole pipeline, as a package enables it.
    pub fn enable_all(&self, stages: &[&str]) {
        self.enable("randt.target", TARGET);
        for stage in stages {
            self.enable(&format!("randt-{stage}.service"), "randt.target");
        }
        for unit in ["randt-mission.service", "randt-recover.service"] {
            self.enable(unit, "randt.target");
        }
    }

    /// Another system's files instead of this machine's, such as an older Debian's.
    pub fn set_root(&self, root: &Path) {
        symlink(root, self.folder.path().join("lower")).unwrap();
    }

    /// Keeps what lies in /var/lib/randt in a file, as on a disk of its own; it must have a file
    /// system.
    pub fn disk(&self, file: &Path) {
        symlink(file, self.folder.path().join("kept")).unwrap();
    }

    /// Boots it.
    pub fn boot(self) -> Machine {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/support/boot.sh");
        let output = self.folder.path().join("output");
        let mut command = Command::new("unshare");
        command.args([
            "--fork",
            "--kill-child",
            "--pid",
            "--mount",
            "--cgroup",
            "--ipc",
        ]);
        command.args(["--uts", "--net"]);
        command.arg(script).arg(self.folder.path()).arg(TARGET);
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let unshare = command
            .stderr(File::create(&output).unwrap())
            .spawn()
            .unwrap();
        let mut machine = Machine {
            unshare,
            init: 0,
            _image: self,
        };
        let begin = Instant::now();
        loop {
            assert!(
                begin.elapsed() < WAIT_MAX && machine.unshare.try_wait().unwrap().is_none(),
                "the machine did not boot: {}",
                fs::read_to_string(&output).unwrap()
            );
            machine.init = child_of(machine.unshare.id()).unwrap_or(0);
            if is_systemd(machine.init) && machine.is_up() {
                return machine;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Machine {
    fn is_up(&self) -> bool {
        let printed = self.run(&["systemctl", "is-active", "basic.target"]);
        printed.stdout.trim() == "active"
    }

    /// A command on it, as root.
    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new("nsenter");
        command.args(["--target", &self.init.to_string(), "--all", "--"]);
        command.args(words);
        command
    }

    /// Runs one to its end.
    pub fn run(&self, words: &[&str]) -> Ended {
        ended(self.command(words))
    }

    /// The same of one that must go well; gives what it printed.
    pub fn good(&self, words: &[&str]) -> String {
        let ended = self.run(words);
        assert_eq!(ended.code, Some(0), "{words:?}: {}", ended.stderr);
        ended.stdout
    }

    /// A property of a unit.
    pub fn property(&self, unit: &str, name: &str) -> String {
        let text = self.good(&["systemctl", "show", "--value", "--property", name, unit]);
        text.trim().to_owned()
    }

    /// The status of a unit.
    pub fn status(&self, unit: &str) -> String {
        self.property(unit, "StatusText")
    }

    /// The journal of a unit.
    pub fn journal(&self, unit: &str, more: &[&str]) -> String {
        // What has been written is to be found.
        self.good(&["journalctl", "--sync"]);
        let mut words = vec!["journalctl", "--unit", unit, "--no-pager"];
        words.extend(more);
        self.good(&words)
    }

    /// A file of the running machine, from here.
    pub fn path(&self, path: &str) -> PathBuf {
        PathBuf::from(format!("/proc/{}/root{path}", self.init))
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        // All of its processes and mounts go with its first process, and that one with the process
        // that has started it.
        let _ = self.unshare.kill();
        let _ = self.unshare.wait();
        let begin = Instant::now();
        while Path::new(&format!("/proc/{}", self.init)).exists() && begin.elapsed() < WAIT_MAX {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn open_to_all(folder: &Path) {
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).unwrap();
}

fn child_of(pid: u32) -> Option<u32> {
    let children = fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).ok()?;
    children.split(' ').next()?.parse().ok()
}

fn is_systemd(pid: u32) -> bool {
    let command = fs::read_to_string(format!("/proc/{pid}/comm"));
    command.is_ok_and(|command| command.trim() == "systemd")
}

//! The processes of all pipelines on this machine, as the kernel shows them: none has to be asked.

use randt_stage::Domain;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Every stage and tool has this file of its domain open.
const PRESENCE: &str = "alive.lock";
/// What the kernel adds to the name of a file that is no more.
const DELETED: &str = " (deleted)";
/// Commands of randt itself that enter a domain.
const COMMANDS: [&str; 3] = ["up", "play", "top"];

/// A file, by whichever name it is reached.
pub type FileId = (u64, u64);

/// A process in a domain.
#[derive(Debug)]
pub struct Process {
    /// Its number.
    pub pid: u32,
    /// Its user.
    pub user: u32,
    /// Such as `randt-filter` or `randt play`.
    pub name: String,
    /// Folder of its domain, as it sees it.
    pub folder: PathBuf,
    /// Its domain's presence file; none where this user may not look.
    pub presence: Option<FileId>,
    /// Whether that was removed under it.
    pub removed: bool,
    /// Whether its program was replaced or removed since it started.
    pub replaced: bool,
    /// The file system that it sees as /dev/shm.
    pub shared_memory: Option<u64>,
    /// Files that it has open.
    pub open: BTreeSet<FileId>,
}

/// All of them but this one.
pub fn all() -> Vec<Process> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    pids.filter(|pid| *pid != std::process::id())
        .filter_map(Process::read)
        .collect()
}

/// Identity of a file.
pub fn id(metadata: &Metadata) -> FileId {
    (metadata.dev(), metadata.ino())
}

impl Process {
    fn read(pid: u32) -> Option<Self> {
        let proc = PathBuf::from(format!("/proc/{pid}"));
        let arguments = arguments(&proc);
        let shared_memory = fs::metadata(proc.join("root/dev/shm"));
        let mut process = Self {
            pid,
            user: fs::metadata(&proc).ok()?.uid(),
            name: name(&arguments),
            folder: PathBuf::new(),
            presence: None,
            removed: false,
            replaced: fs::read_link(proc.join("exe")).is_ok_and(|exe| is_deleted(&exe)),
            shared_memory: shared_memory.ok().map(|found| found.dev()),
            open: BTreeSet::new(),
        };
        // Another user's, or one that systemd keeps in a user namespace of its own (PrivateUsers),
        // lists its files to nobody or shows none of them: its command line is all that is known.
        let may_look = fs::read_link(proc.join("exe")).is_ok();
        match fs::read_dir(proc.join("fd")) {
            Ok(files) if may_look => files.flatten().for_each(|file| process.add(&file.path())),
            _ if is_stage(&arguments) => {
                process.folder = domain_folder(&proc, &arguments, process.user)?
            }
            _ => {}
        }
        (!process.folder.as_os_str().is_empty()).then_some(process)
    }

    fn add(&mut self, file: &Path) {
        let (Ok(target), Ok(metadata)) = (fs::read_link(file), fs::metadata(file)) else {
            return;
        };
        self.open.insert(id(&metadata));
        let text = target.to_string_lossy();
        let name = text.strip_suffix(DELETED).unwrap_or(&text);
        let path = Path::new(name);
        if path.file_name().is_some_and(|name| name == PRESENCE) {
            self.folder = path.parent().unwrap_or(path).to_owned();
            self.presence = Some(id(&metadata));
            self.removed = is_deleted(&target);
        }
    }
}

impl std::fmt::Display for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (process {})", self.name, self.pid)
    }
}

/// The identity of a domain's presence file.
pub fn presence(folder: &Path) -> Option<FileId> {
    Some(id(&fs::metadata(folder.join(PRESENCE)).ok()?))
}

fn is_deleted(path: &Path) -> bool {
    path.to_string_lossy().ends_with(DELETED)
}

fn arguments(proc: &Path) -> Vec<String> {
    let text = fs::read(proc.join("cmdline")).unwrap_or_default();
    let arguments = text.split(|byte| *byte == 0).map(String::from_utf8_lossy);
    arguments.map(Cow::into_owned).collect()
}

/// The program, with its command where it is randt itself.
fn name(arguments: &[String]) -> String {
    let program = arguments.first().map_or("", String::as_str);
    let program = program.rsplit('/').next().unwrap_or_default();
    match arguments.get(1) {
        Some(command) if program == "randt" => format!("randt {command}"),
        _ => program.to_owned(),
    }
}

fn is_stage(arguments: &[String]) -> bool {
    let name = name(arguments);
    let command = name.strip_prefix("randt ");
    name.starts_with("randt-") || command.is_some_and(|command| COMMANDS.contains(&command))
}

/// The domain that the command line of a process names.
fn domain_folder(proc: &Path, arguments: &[String], user: u32) -> Option<PathBuf> {
    let option = |name: &str| {
        let with_value = format!("{name}=");
        let given = arguments.iter().enumerate().find_map(|(i, argument)| {
            if argument == name {
                return arguments.get(i + 1).cloned();
            }
            argument.strip_prefix(&with_value).map(str::to_owned)
        });
        given.filter(|value| !value.is_empty())
    };
    let working = fs::read_link(proc.join("cwd")).unwrap_or_default();
    let run = option("--run").map(|run| working.join(run));
    let run = run.unwrap_or_else(|| Domain::default_run(user));
    Some(run.join(option("--prefix").unwrap_or_else(|| "randt".to_owned())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn stages_and_the_tools_that_enter_a_domain_are_recognised() {
        for stage in [
            "/opt/randt-filter --run /r",
            "randt play x.mcap",
            "./randt up",
        ] {
            assert!(is_stage(&words(stage)), "{stage}");
        }
        for other in [
            "randt",
            "randt doctor",
            "cat randt-filter",
            "/bin/sh -c randt-filter",
            "",
        ] {
            assert!(!is_stage(&words(other)), "{other}");
        }
        assert_eq!(name(&words("/opt/randt play x")), "randt play");
    }

    #[test]
    fn a_domain_is_read_from_the_command_line_where_nothing_else_is_known() {
        let domain_folder =
            |text: &str| domain_folder(Path::new("/proc/no-such"), &words(text), 7).unwrap();
        assert_eq!(
            domain_folder("randt-filter --run /r --prefix p"),
            Path::new("/r/p")
        );
        assert_eq!(
            domain_folder("randt-filter --prefix=q --run=/s"),
            Path::new("/s/q")
        );
    }
}

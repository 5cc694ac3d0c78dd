//! What can go wrong between a stage and its machine.

use crate::ports::exhausted_resource;
use std::path::PathBuf;

/// Errors of the process shell.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A name that cannot be part of a file's.
    #[error("prefix \"{0}\": expected 1 to 24 letters, digits or hyphens")]
    BadPrefix(String),
    /// Sockets in the folder would have longer paths than the system allows.
    #[error("{}: {over} characters too long for the sockets in it: give --run a shorter folder, or a shorter --prefix, which counts twice", path.display())]
    LongPath {
        /// The domain's folder.
        path: PathBuf,
        /// By how much.
        over: usize,
    },
    /// A file or folder of the domain.
    #[error("{}: {what}: {cause}", path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// What failed.
        what: &'static str,
        /// Why not.
        cause: std::io::Error,
    },
    /// The domain belongs to another user.
    #[error("{}: belongs to user {owner}, this process is user {user}: all stages must run as one user; start it as that user (sudo -u '#{owner}' ...), or give --run another folder", path.display())]
    OtherUser {
        /// The run folder.
        path: PathBuf,
        /// Its owner.
        owner: u32,
        /// Ours.
        user: u32,
    },
    /// Another user could change what is in a folder.
    #[error("{}: mode {mode:o}: other users may write to it and put anything in the place of what is there; see what is in it, then chmod go-w it, or give --run another folder", path.display())]
    OpenToOthers {
        /// The folder.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// Another user made a file of shared memory by the name that this domain's has.
    #[error("{}: belongs to user {owner}, this process is user {user}: stages would share memory with that user; remove it (sudo rm {}), or give all stages another --prefix", path.display(), path.display())]
    OtherUsersMemory {
        /// The file.
        path: PathBuf,
        /// Its owner.
        owner: u32,
        /// Ours.
        user: u32,
    },
    /// The same stage runs already.
    #[error("randt-{stage} runs already as process {pid} in {}: stop it first (kill {pid}), or give this one another --prefix", run.display())]
    RunsAlready {
        /// Name.
        stage: String,
        /// The process that holds it.
        pid: u64,
        /// The run folder.
        run: PathBuf,
    },
    /// The most programs that may watch do so already.
    #[error("{most} programs watch the pipeline in {} already: end one of them (randt top)", run.display())]
    TooManyWatch {
        /// The domain's folder.
        run: PathBuf,
        /// How many may.
        most: usize,
    },
    /// Another stage was built with another layout.
    #[error(
        "{topic}: this build has the layout {ours}, but {holder} has {theirs}: the two were built from different sources; restart {restart} from the same build as this one, or put the build back that this one had before"
    )]
    Layout {
        /// Topic.
        topic: &'static str,
        /// Type name of this build.
        ours: &'static str,
        /// The other one.
        theirs: String,
        /// The stages that have it.
        holder: String,
        /// The stages that have to be restarted.
        restart: String,
    },
    /// Not enough memory for the segments.
    #[error("{}: {free_mb:.1} MB free, randt-{stage} needs {needed_mb:.1} MB of memory there for {what}; free some (randt doctor --clean, when no stage runs) or enlarge it: mount -o remount,size=256M {}", path.display(), path.display())]
    TooLittleMemory {
        /// Where.
        path: PathBuf,
        /// Stage.
        stage: String,
        /// Free, MB.
        free_mb: f64,
        /// Needed, MB.
        needed_mb: f64,
        /// For what.
        what: String,
    },
    /// Memory was there when it was counted, and is taken by others now.
    #[error("{}: {free_mb:.1} MB free, {what} needs {needed_mb:.3} MB more: free some, or enlarge it: mount -o remount,size=256M {}", path.display(), path.display())]
    NoRoom {
        /// Where.
        path: PathBuf,
        /// A topic, or a table.
        what: String,
        /// Free, MB.
        free_mb: f64,
        /// Needed, MB.
        needed_mb: f64,
    },
    /// Shared memory was removed or cut while it was in use.
    #[error("{}: was removed or cut while randt-{stage} used it ({files} in all): what it sends reaches no stage that starts from now on; start it again, so that all share new memory. logind does this at a user's logout (prevented by RemoveIPC=no in /etc/systemd/logind.conf, or by a system user), and so does a user who clears /dev/shm", path.display())]
    MemoryGone {
        /// One of the files.
        path: PathBuf,
        /// Stage.
        stage: String,
        /// How many files.
        files: usize,
    },
    /// The system gives this process no more of something.
    #[error("out of {0}; without it, ports that are opened later would not connect")]
    Exhausted(String),
    /// iceoryx2 refused.
    #[error("{what}: {cause}{}", hint(cause))]
    Bus {
        /// What was tried.
        what: String,
        /// iceoryx2's error.
        cause: String,
    },
}

impl Error {
    pub(crate) fn bus(what: impl Into<String>, cause: impl std::fmt::Debug) -> Self {
        // iceoryx2 has one error for all that the system refuses.
        let exhausted_resource = exhausted_resource();
        let why = exhausted_resource.map_or(String::new(), |what| format!(", out of {what}"));
        Self::Bus {
            what: what.into(),
            cause: format!("{cause:?}{why}"),
        }
    }

    pub(crate) fn file(
        path: impl Into<PathBuf>,
        what: &'static str,
    ) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::File { path, what, cause }
    }
}

/// Explains a bare error of iceoryx2.
fn hint(cause: &str) -> &'static str {
    if cause.contains("ExceedsMaxSupported") {
        " (too many ports, living or left over: randt doctor lists them)"
    } else if cause.contains("InternalError") || cause.contains("Permission") {
        " (often another user's files: randt doctor lists them)"
    } else {
        ""
    }
}

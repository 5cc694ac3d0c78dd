//! A stage that a supervisor has started ends with it, however that ends.

use rustix::process::{
    Pid, Signal, getpid, getppid, kill_process, set_parent_process_death_signal,
};

/// From now on the end of `parent` is a SIGTERM to this process.
pub fn end_with(parent: u32) {
    // The kernel refuses no signal that exists.
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
    // If it has ended before, the signal never comes.
    let lives = getppid().map(Pid::as_raw_pid) == i32::try_from(parent).ok();
    if !lives {
        let _ = kill_process(getpid(), Signal::TERM);
    }
}

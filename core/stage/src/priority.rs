//! Who goes first where processors are few.

use rustix::process::{getpriority_process, setpriority_process};

/// Behind the stages that compute, and far before work that may wait for ever.
const BEHIND: i32 = 5;

/// Lets the pipeline go first: for stages that look on. Before the process has a second thread, which would stay as it is.
pub fn go_behind() {
    // Under systemd the unit has said it, and refuses the call.
    if getpriority_process(None).is_ok_and(|now| now < BEHIND) {
        let _ = setpriority_process(None, BEHIND);
    }
}

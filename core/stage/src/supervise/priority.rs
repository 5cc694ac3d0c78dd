//! Which stages run first when processors are few.

use rustix::process::{getpriority_process, setpriority_process};

/// Nice level below the stages that compute, and far above work that may wait for ever.
const NICE: i32 = 5;

/// Lets the pipeline run first: for stages that only watch. Call it before the process has a
/// second thread, whose priority would not change.
pub fn lower_priority() {
    // Under systemd the unit sets it, and refuses the call.
    if getpriority_process(None).is_ok_and(|now| now < NICE) {
        let _ = setpriority_process(None, NICE);
    }
}

//! Whether this process has run out of what the system gives it: descriptors, memory.
//!
//! iceoryx2 opens files when another port appears, while messages are sent and received. Where
//! that fails it goes on without: the two ports never connect, and no error is returned. A peer
//! that died while it started is a failure of that kind too, and not this process's; running out
//! is one, and ends it with a message, so that it is started anew.

use crate::Error;
use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};
use rustix::process::{Resource, getrlimit};
use std::fs::File;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A connection maps a segment of this size, more or less.
const SEGMENT_BYTES: usize = 16 << 20;

/// iceoryx2 opens some descriptors at once and closes them again where one is missing: fewer than
/// this do not suffice.
const SPARE_DESCRIPTORS: usize = 8;

/// Shared by all ports of a process; set where one could not connect because the process has run
/// out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exhausted(Arc<AtomicBool>);

impl Exhausted {
    /// What a port does where it cannot connect.
    pub(crate) fn on_failure(
        &self,
    ) -> impl Fn(DegradationCause, &DegradationInfo) -> DegradationAction + Send + 'static {
        let exhausted = Arc::clone(&self.0);
        move |_, _| {
            if exhausted_resource().is_some() {
                exhausted.store(true, Ordering::Relaxed);
            }
            DegradationAction::Ignore
        }
    }

    /// Refuses to go on where a port could not connect.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !self.0.load(Ordering::Relaxed) {
            return Ok(());
        }
        let what = exhausted_resource().unwrap_or_else(|| "descriptors or memory".to_owned());
        Err(Error::Exhausted(what))
    }
}

/// The resource that this process has none left of, for people.
pub(crate) fn exhausted_resource() -> Option<String> {
    let spare = (0..SPARE_DESCRIPTORS).map(|_| File::open("/dev/null"));
    if spare.collect::<Result<Vec<File>, _>>().is_err() {
        let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
        return Some(format!(
            "descriptors: it may have {limit} open (ulimit -n, LimitNOFILE=)"
        ));
    }
    let memory = Vec::<u8>::new().try_reserve_exact(SEGMENT_BYTES);
    memory
        .is_err()
        .then(|| "memory (ulimit -v, LimitAS=)".to_owned())
}

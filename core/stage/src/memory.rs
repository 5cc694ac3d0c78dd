//! The memory that a process shares: counted before it is used, taken before it is written,
//! watched while it is in use.

mod budget;
mod preallocation;
mod watch;

pub(crate) use budget::MemoryBudget;
pub(crate) use preallocation::{MessageMemory, take_tables};
pub(crate) use watch::MemoryWatch;
pub use watch::memory_gone;

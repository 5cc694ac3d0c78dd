//! What makes the mapper a process: keyframes into journal and map, the map to whoever reads it.

mod behind;
mod intake;
mod outlet;
mod past;

pub use intake::Intake;
pub use outlet::Outlet;

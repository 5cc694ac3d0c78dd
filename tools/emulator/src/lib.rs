//! Emulated radars and IMUs: a log played in the wire protocols of real sensors, with every fault
//! they have.
//!
//! Responsible for the sensors' side of each protocol, in time with a clock that two emulators of
//! one log share. Not responsible for the codecs: they are the drivers' own, used in the other
//! direction, and tested there with the vendors' published bytes.

mod error;
mod fault;
pub mod imu;
mod pace;
pub mod radar;
mod recording;
mod wrong_content;

pub use error::Error;
pub use fault::{Fault, FaultKind, Faults};
pub use pace::Pace;
pub use recording::Recording;

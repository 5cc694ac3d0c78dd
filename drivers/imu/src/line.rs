//! Text lines, for any IMU and any velocity of the robot: a protocol of our own, docs/lines.md.

mod buffer;
mod decoder;
mod message;
mod order;
mod senders;
mod source;
mod wire;

pub use decoder::LineDecoder;
pub use message::{ImuLine, LINE_MAX, LineError, LineMessage, TwistLine};
pub(crate) use source::LineSource;
pub use source::TwistReading;

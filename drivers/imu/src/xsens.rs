//! Xsens MTData2: a serial protocol of messages of items.
//!
//! Source: Xsens MT Low Level Communication Protocol (MT0101P).

mod item;
mod message;
mod protocol;
mod setup;

pub use item::Item;
pub use message::{Items, Message, XsensFraming};
pub use protocol::Xsens;
pub use setup::{Step, XsensCodec, id};

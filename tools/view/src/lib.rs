//! A running pipeline, live, for Foxglove and Lichtblick.
//!
//! What viewers get is never a queue: of everything only the newest waits, and how much is under way to a viewer at once
//! is measured, so that a slow link shows less often what is young, not as often what is old. Pure but for `connection`
//! and `server`: those have the sockets, none of which is ever waited for.

mod board;
mod channels;
mod client;
mod connection;
mod flow;
mod pieces;
pub mod protocol;
mod server;
mod words;

pub use board::Board;
pub use channels::Shown;
pub use client::{Client, Frame};
pub use flow::Flow;
pub use server::{Server, check_address};

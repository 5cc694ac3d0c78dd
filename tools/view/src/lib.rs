//! A running pipeline, live, for Foxglove and Lichtblick.
//!
//! What viewers get is never a queue: of everything only the newest waits, and how much is under way to a viewer at once
//! is measured, so that a slow link shows less often what is young, not as often what is old. Pure but for `handshake`,
//! `connection` and `server`: those have the sockets, none of which is ever waited for. Who may watch is in `access`.

mod access;
mod board;
mod channels;
mod client;
mod client_log;
mod connection;
mod flow;
mod handshake;
mod limits;
mod pieces;
pub mod protocol;
mod server;
mod words;

pub use access::{AccessPolicy, Refusal};
pub use board::Board;
pub use channels::Shown;
pub use client::{Client, Frame};
pub use flow::Flow;
pub use limits::ViewerLimits;
pub use server::{Server, check_address};

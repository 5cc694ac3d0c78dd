//! A running pipeline, live, for Foxglove and Lichtblick.
//!
//! Nothing queues for viewers: of everything only the newest waits, and how much is under way to a
//! viewer at once is measured, so that a slow link shows recent data less often instead of old
//! data as often. Only `handshake`, `connection` and `server` have I/O, on sockets that never
//! block. Who may watch is in `access`.

mod access;
mod board;
mod client;
mod client_log;
mod connection;
mod flow;
mod handshake;
mod limits;
pub mod protocol;
mod sent_entities;
mod server;
mod status_text;

pub use access::{AccessPolicy, Refusal};
pub use board::Board;
pub use client::{Client, Frame};
pub use flow::Flow;
pub use limits::ViewerLimits;
pub use server::{Server, check_address};

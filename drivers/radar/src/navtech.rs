//! Navtech CTS and CIR: Colossus over TCP.
//!
//! Responsible for the protocol both ways and for the connection. Public: Navtech's IASDK (MIT)
//! and its wiki.

mod client;
pub mod configuration;
mod decoder;
pub mod fft;
pub mod frame;
pub mod order;

pub use client::NavtechClient;
pub use decoder::NavtechDecoder;

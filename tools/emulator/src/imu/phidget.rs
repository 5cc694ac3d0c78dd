//! A Phidgets Spatial behind a Phidget network server.
//!
//! The vendor's library speaks this protocol (2.4) as a client; what is here was worked out from
//! what it sends and accepts. It has no document.

mod client;
mod packet;
mod server;
mod spatial;

pub use server::PhidgetServer;

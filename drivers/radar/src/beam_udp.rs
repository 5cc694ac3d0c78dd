//! beam-udp: a documented protocol of our own (docs/beam-udp.md) for radars whose own is not
//! public.
//!
//! Responsible for the protocol both ways and for its socket.

mod crc;
mod decoder;
mod fragments;
pub mod packet;
mod socket;

pub use decoder::BeamUdpDecoder;
pub use socket::BeamUdpSocket;
pub(crate) use socket::Listening;

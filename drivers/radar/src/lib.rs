//! A spinning radar's bytes to `radar/scan`.
//!
//! Responsible for protocols (Navtech's Colossus, our beam-udp), for choosing the radar's beams
//! among those of all senders, for joining them to sweeps and for their times. The codecs, the
//! streams, the assembler and the timing are pure; I/O is in `navtech/client.rs`,
//! `beam_udp/socket.rs`, `poller.rs` and `image_writer.rs`. Not responsible for what is in a
//! sweep: that is `filter`'s.
//!
//! The protocol of the indurad iSDR-C is not public. Nothing here speaks it: an iSDR-C is bridged
//! to beam-udp (docs/beam-udp.md), or decoded by a [`BeamDecoder`] written with its documentation.

mod assembler;
mod beam;
mod beam_source;
pub mod beam_udp;
mod bytes;
mod counters;
mod decoder;
mod dense;
mod error;
mod image_writer;
pub mod navtech;
mod poller;
mod radar;
mod returns;
mod sender;
mod streams;
mod sweep;
mod sweep_monitor;
mod timing;

pub use assembler::Assembler;
pub use beam::{BeamLayout, BeamPosition, Echo, RawBeam};
pub use beam_source::{BeamSink, BeamSource};
pub use decoder::BeamDecoder;
pub use dense::{DenseRows, PolarImage};
pub use error::Error;
pub use poller::Poller;
pub use radar::Radar;
pub use sender::Sender;
pub use streams::Streams;
pub use sweep::Sweep;

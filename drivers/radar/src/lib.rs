//! A spinning radar's bytes to `radar/scan`.
//!
//! Responsible for protocols (Navtech's Colossus, our beam-udp), for whose beams are the radar's, for joining them to
//! sweeps and for their times. The codecs, the streams, the assembler and the timing are pure; I/O is in `navtech/client.rs`, `beam_udp/socket.rs`, `poller.rs` and `recorder.rs`.
//! Not responsible for what a sweep means: that is `filter`'s.
//!
//! The protocol of the indurad iSDR-C is not public. Nothing here speaks it: an iSDR-C is bridged to beam-udp
//! (docs/beam-udp.md), or decoded by a [`BeamDecoder`] that somebody writes who has it.

mod assembler;
mod beam;
pub mod beam_udp;
mod bytes;
mod condition;
mod decoder;
mod dense;
mod error;
pub mod navtech;
mod poller;
mod radar;
mod recorder;
mod returns;
mod sender;
mod source;
mod streams;
mod sweep;
mod timing;

pub use assembler::Assembler;
pub use beam::{BeamLayout, Echo, Place, RawBeam};
pub use decoder::BeamDecoder;
pub use dense::{DenseRows, PolarImage};
pub use error::Error;
pub use poller::Poller;
pub use radar::Radar;
pub use sender::Sender;
pub use source::{Sink, Source};
pub use streams::Streams;
pub use sweep::Sweep;

//! Where a radar's protocol goes in: bytes to beams.
//!
//! A decoder for a radar whose protocol is not public here, such as the iSDR-C's own, is one
//! struct with this trait and one [`BeamSource`](crate::BeamSource) that hands it what its socket
//! receives; `navtech/decoder.rs` (a stream) and `beam_udp/decoder.rs` (datagrams) are the
//! examples. Nothing after it has to change.

use crate::RawBeam;
use randt_device::Count;

/// Bytes in, beams out. No I/O, no clock: time comes in.
pub trait BeamDecoder {
    /// Takes bytes as they came, a datagram or any piece of a stream, that reached the host at
    /// `arrival_ns`, and hands out every beam that they complete, in the order of the wire. What
    /// cannot be read is counted and passed over.
    fn decode(&mut self, bytes: &[u8], arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam));

    /// The connection is a new one: what was half read is forgotten.
    fn restart(&mut self);

    /// Gives all counters.
    fn counts(&self, visit: &mut dyn FnMut(Count));
}

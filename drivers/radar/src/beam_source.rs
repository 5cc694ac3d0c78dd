//! The one trait of all radars: a source that is polled for beams.

use crate::RawBeam;
use randt_device::{Count, Link};

/// Takes a source's beams.
pub trait BeamSink {
    /// A beam, in the order of the wire.
    fn beam(&mut self, beam: &RawBeam);
    /// What follows does not continue what was before: the connection is a new one.
    fn restarted(&mut self);
}

/// A radar that is reached, lost and reached again. Nothing here returns an error: what is wrong
/// is in [`BeamSource::link`].
pub trait BeamSource {
    /// Takes all that has come, and does what is due. Called whenever the poller has something,
    /// and at [`BeamSource::due_ns`].
    fn poll(&mut self, now_ns: i64, sink: &mut dyn BeamSink);

    /// When [`BeamSource::poll`] is to be called again even if nothing comes, ns.
    fn due_ns(&self) -> i64;

    /// Its beams make no sweeps: begins anew with the radar, as far as it can.
    fn reconnect(&mut self, now_ns: i64, sink: &mut dyn BeamSink);

    /// The state of the radar's link: whether beams come.
    fn link(&self) -> &Link;

    /// Gives all counters.
    fn counts(&self, visit: &mut dyn FnMut(Count));
}

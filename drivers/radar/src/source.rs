//! The one trait of all radars: something to sleep on that now and then has beams.

use crate::RawBeam;
use randt_device::{Count, Link};

/// Who takes a source's beams.
pub trait Sink {
    /// A beam, in the order of the wire.
    fn beam(&mut self, beam: &RawBeam);
    /// What follows does not continue what was before: the connection is a new one.
    fn restarted(&mut self);
}

/// A radar that is reached, lost and reached again. Nothing here fails: what is wrong is in [`Source::link`].
pub trait Source {
    /// Takes all that has come, and does what is due. Called whenever the poller has something, and at
    /// [`Source::due_ns`].
    fn poll(&mut self, now_ns: i64, sink: &mut dyn Sink);

    /// When [`Source::poll`] is to be called again even if nothing comes, ns.
    fn due_ns(&self) -> i64;

    /// Its beams make no sweeps, however long: begins anew with the radar, as far as it can.
    fn begin_anew(&mut self, now_ns: i64, sink: &mut dyn Sink);

    /// How it stands to the radar: whether beams come.
    fn link(&self) -> &Link;

    /// What is known of the radar, for people, such as its model.
    fn about(&self) -> String;

    /// Tells all counters.
    fn counts(&self, tell: &mut dyn FnMut(Count));
}

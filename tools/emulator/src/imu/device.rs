//! What a serial device does in its protocol.

use super::Moment;
use crate::wrong::Wrong;

/// A device without its port: commands in, answers and measurements out. Switched on it is idle: it streams only what
/// it was told to.
pub(super) trait Device: Send {
    /// Takes what the host sent; gives the answers.
    fn take(&mut self, bytes: &[u8]) -> Vec<u8>;

    /// A measurement as a message; none where it is not to be sent.
    fn message(&self, moment: &Moment, interval_ns: i64) -> Option<Vec<u8>>;

    /// A message of its own accord, well-formed and with wrong content.
    fn wrong(&self, moment: &Moment, wrong: &mut Wrong) -> Vec<u8>;

    /// The beginning of a message that claims to be longer than any.
    fn oversize(&self) -> &'static [u8];
}

/// Whether a device that measures every `interval_ns` and was asked for one every `asked_ns` sends this one.
pub(super) fn is_asked_for(moment: &Moment, interval_ns: i64, asked_ns: i64) -> bool {
    let every = (asked_ns as f64 / interval_ns as f64 + 0.5) as u64;
    moment.number.is_multiple_of(every.max(1))
}

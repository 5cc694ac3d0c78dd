//! What a serial device does in its protocol.

use super::ImuMeasurement;
use crate::wrong_content::WrongContent;
use randt_messages::Twist;

/// A device without its port: commands in, answers and measurements out. Switched on it is idle:
/// it streams only what it was configured to.
pub(super) trait Device: Send {
    /// Takes what the host sent; gives the answers.
    fn take(&mut self, bytes: &[u8]) -> Vec<u8>;

    /// A measurement as a message; none where it is not to be sent.
    fn message(&self, measurement: &ImuMeasurement, interval_ns: i64) -> Option<Vec<u8>>;

    /// An unrequested message, well-formed and with wrong content.
    fn wrong(&self, measurement: &ImuMeasurement, wrong: &mut WrongContent) -> Vec<u8>;

    /// A velocity of the robot as a message; none where the protocol has none.
    fn twist(&self, _number: u64, _device_ns: i64, _twist: &Twist) -> Option<Vec<u8>> {
        None
    }

    /// Lets its checksum be wrong.
    fn damage(&self, message: &mut [u8]) {
        if let Some(last) = message.last_mut() {
            *last ^= 0x55;
        }
    }

    /// The beginning of a message that claims to be longer than any.
    fn oversize(&self) -> &'static [u8];
}

/// Whether a device that measures every `interval_ns` and was asked for one every `asked_ns` sends
/// this one.
pub(super) fn is_asked_for(measurement: &ImuMeasurement, interval_ns: i64, asked_ns: i64) -> bool {
    let every = (asked_ns as f64 / interval_ns as f64 + 0.5) as u64;
    measurement.number.is_multiple_of(every.max(1))
}

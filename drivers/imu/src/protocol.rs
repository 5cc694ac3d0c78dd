//! What a serial protocol does for its port.

use crate::{frames::FrameCounts, reading::Reading};
use std::fmt::Debug;

/// A protocol, without its port: bytes in, readings and commands out.
pub trait Protocol: Debug {
    /// The port was opened: half a frame is forgotten, and the device is configured again.
    fn opened(&mut self);

    /// Takes what was read.
    fn take(&mut self, bytes: &[u8], arrival_ns: i64, readings: &mut Vec<Reading>);

    /// A command that is to be sent now.
    fn send(&mut self, now_ns: i64) -> Option<Vec<u8>>;

    /// When [`Self::send`] may have something; none once the device is configured.
    fn due_ns(&self) -> Option<i64>;

    /// What was counted.
    fn counts(&self) -> FrameCounts;

    /// What the device refused, or an empty text.
    fn complaint(&self) -> &str;

    /// From one reading to the next, ns, as the device has agreed to, else as it is configured here.
    fn interval_ns(&self) -> i64;
}

/// Nanoseconds between readings at a rate. At least one: a rate is finite and positive (`imu.rate_hz`).
pub(crate) fn interval_ns(rate_hz: f64) -> i64 {
    ((1e9 / rate_hz) as i64).max(1)
}

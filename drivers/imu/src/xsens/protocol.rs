//! Xbus as a serial protocol: messages to readings.

use super::{Item, Message, XsensCodec};
use crate::protocol::Framed;
use crate::reading::Reading;

/// Unit of the sample time.
const TICK_NS: i64 = 100_000;

/// An Xsens device.
pub type Xsens = Framed<XsensCodec>;

/// The sample time beyond 2^32.
#[derive(Debug, Default)]
pub(super) struct Ticks {
    turns: i64,
    last: u32,
}

impl Ticks {
    fn device_ns(&mut self, ticks: u32) -> i64 {
        // A step back by over half its range is its end (after five days); any other one is a
        // device begun anew.
        self.turns += i64::from(self.last.saturating_sub(ticks) > u32::MAX / 2);
        self.last = ticks;
        ((self.turns << 32) + i64::from(ticks)).saturating_mul(TICK_NS)
    }
}

/// A message of measurements as a reading; none where rate or acceleration is not in it.
pub(super) fn reading(
    message: &Message<'_>,
    arrival_ns: i64,
    ticks: &mut Ticks,
) -> Option<Reading> {
    let (mut rate, mut acceleration) = (None, None);
    let mut reading = Reading {
        arrival_ns,
        ..Reading::default()
    };
    for (id, data) in message.items() {
        match Item::decode(id, data) {
            Some(Item::PacketCounter(count)) => reading.counter = Some(count),
            Some(Item::SampleTimeFine(time)) => reading.device_ns = Some(ticks.device_ns(time)),
            Some(Item::Acceleration(values)) => acceleration = Some(values),
            Some(Item::RateOfTurn(values)) => rate = Some(values),
            None => {}
        }
    }
    reading.rate_rad_s = rate?.map(f64::from);
    reading.acceleration_m_s2 = acceleration?.map(f64::from);
    Some(reading)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message as a device sent it: a comment in antymistor/RS485, Demo/HARDWARE/MTI/MTI.h.
    const DEVICE: &[u8] = &[
        0xFA, 0xFF, 0x36, 0x31, 0x10, 0x20, 0x02, 0xDF, 0xC5, 0x10, 0x60, 0x04, 0x00, 0x45, 0x9D,
        0xA0, 0x40, 0x20, 0x0C, 0xBE, 0xDC, 0x9A, 0xFA, 0x3F, 0x54, 0x9F, 0x37, 0x41, 0x1C, 0xBB,
        0x70, 0x80, 0x20, 0x0C, 0xBB, 0xAA, 0x5C, 0x80, 0x3B, 0x8C, 0x55, 0x01, 0xBB, 0x81, 0x33,
        0x00, 0xE0, 0x20, 0x04, 0x00, 0x00, 0x00, 0x81, 0x45,
    ];

    #[test]
    fn a_message_is_a_reading() {
        let mut xsens = Xsens::new(100.0);
        let mut readings = Vec::new();
        xsens.take(DEVICE, 7, &mut readings);
        assert_eq!(xsens.counts().frames, 1);
        let reading = readings[0];
        assert_eq!(reading.counter, Some(0xDFC5));
        assert_eq!(reading.device_ns, Some(0x459DA0 * 100_000));
        assert!((reading.acceleration_m_s2[2] - 9.796).abs() < 0.001);
        assert!(reading.rate_rad_s.iter().all(|rate| rate.abs() < 0.01));
    }

    #[test]
    fn the_sample_time_goes_on_beyond_its_range() {
        let mut ticks = Ticks::default();
        assert_eq!(ticks.device_ns(u32::MAX), 429_496_729_500_000);
        assert_eq!(ticks.device_ns(9), 429_496_730_500_000);
        // Begun anew.
        let mut ticks = Ticks::default();
        ticks.device_ns(1000);
        assert_eq!(ticks.device_ns(10), 1_000_000);
    }
}

//! How an Xsens device is configured after each open: to its configuration state, say what is sent and how often, to
//! its measurement state.
//!
//! Source: MT0101P, GoToConfig, SetOutputConfiguration, GoToMeasurement.

use super::item::{ACCELERATION, PACKET_COUNTER, RATE_OF_TURN, SAMPLE_TIME_FINE};
use super::message::Message;
use crate::conversation::{Conversation, Turn};
use crate::protocol::interval_ns;

/// Message identifiers.
pub mod id {
    /// To measuring.
    pub const GO_TO_MEASUREMENT: u8 = 0x10;
    /// To configuring.
    pub const GO_TO_CONFIG: u8 = 0x30;
    /// Measurements.
    pub const MT_DATA2: u8 = 0x36;
    /// One byte: what the device does not like.
    pub const ERROR: u8 = 0x42;
    /// Pairs of data identifier and rate, Hz; the answer has what the device makes of them.
    pub const OUTPUT_CONFIGURATION: u8 = 0xC0;

    /// The answer to a message.
    pub const fn ack(message: u8) -> u8 {
        message.wrapping_add(1)
    }
}

/// Rate of items that come with every message, whatever its rate.
const WITH_EVERY_MESSAGE: u16 = 0xFFFF;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Config,
    Output,
    Measurement,
    Done,
}

impl Step {
    fn message(self) -> Option<u8> {
        match self {
            Self::Config => Some(id::GO_TO_CONFIG),
            Self::Output => Some(id::OUTPUT_CONFIGURATION),
            Self::Measurement => Some(id::GO_TO_MEASUREMENT),
            Self::Done => None,
        }
    }

    fn next(self) -> Self {
        match self {
            Self::Config => Self::Output,
            Self::Output => Self::Measurement,
            Self::Measurement | Self::Done => Self::Done,
        }
    }
}

/// Configures a device.
#[derive(Debug)]
pub struct XsensSetup {
    rate_hz: u16,
    granted_hz: u16,
    talk: Conversation<Step>,
    complaint: String,
}

impl XsensSetup {
    /// For so many readings a second; the protocol has whole ones.
    pub fn new(rate_hz: f64) -> Self {
        let rate_hz = ((rate_hz + 0.5) as u16).max(1);
        Self {
            rate_hz,
            granted_hz: rate_hz,
            talk: Conversation::at(Step::Config),
            complaint: String::new(),
        }
    }

    /// From the beginning.
    pub fn restart(&mut self) {
        self.talk = Conversation::at(Step::Config);
        self.complaint.clear();
    }

    /// The message to send now.
    pub fn send(&mut self, now_ns: i64) -> Option<Vec<u8>> {
        loop {
            let message = self.talk.step().message()?;
            match self.talk.turn(now_ns) {
                Turn::Wait => return None,
                Turn::GiveUp => self.go_on(),
                Turn::Send if message == id::OUTPUT_CONFIGURATION => {
                    return Some(Message::encode(message, &self.output()));
                }
                Turn::Send => return Some(Message::encode(message, &[])),
            }
        }
    }

    fn output(&self) -> Vec<u8> {
        [
            (PACKET_COUNTER, WITH_EVERY_MESSAGE),
            (SAMPLE_TIME_FINE, WITH_EVERY_MESSAGE),
            (ACCELERATION, self.rate_hz),
            (RATE_OF_TURN, self.rate_hz),
        ]
        .iter()
        .flat_map(|(item, rate)| [item.to_be_bytes(), rate.to_be_bytes()])
        .flatten()
        .collect()
    }

    /// Takes a message that is not MTData2.
    pub fn take(&mut self, message: &Message<'_>) {
        let Some(sent) = self.talk.step().message() else {
            return;
        };
        if message.id == id::ERROR {
            let code = message.data.first().copied().unwrap_or_default();
            self.complaint = format!("the device refuses message {sent:02X}: error {code}");
            self.go_on();
        } else if message.id == id::ack(sent) {
            if sent == id::OUTPUT_CONFIGURATION {
                self.granted(message.data);
            }
            self.go_on();
        }
    }

    /// A device sends at a divisor of its base rate, and says which.
    fn granted(&mut self, data: &[u8]) {
        for [item_high, item_low, high, low] in data.as_chunks().0 {
            let hz = u16::from_be_bytes([*high, *low]);
            if u16::from_be_bytes([*item_high, *item_low]) == RATE_OF_TURN && hz > 0 {
                self.granted_hz = hz;
                if hz != self.rate_hz {
                    self.complaint =
                        format!("the device gives {hz} Hz instead of {}", self.rate_hz);
                }
            }
        }
    }

    fn go_on(&mut self) {
        self.talk = Conversation::at(self.talk.step().next());
    }

    /// When there may be something to send.
    pub fn due_ns(&self) -> Option<i64> {
        (self.talk.step() != Step::Done).then_some(self.talk.due_ns())
    }

    /// What the device refused, or an empty text.
    pub fn complaint(&self) -> &str {
        &self.complaint
    }

    /// From one reading to the next, ns.
    pub fn interval_ns(&self) -> i64 {
        interval_ns(f64::from(self.granted_hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(setup: &mut XsensSetup, id: u8, data: &[u8]) -> Vec<u8> {
        setup.take(&Message { id, data });
        setup.send(0).unwrap_or_default()
    }

    /// Bytes: ours, from MT0101P's tables; those without data as in einride/xsens-go.
    #[test]
    fn the_device_is_configured_step_by_step() {
        let mut setup = XsensSetup::new(250.0);
        assert_eq!(setup.send(0).unwrap(), [0xFA, 0xFF, 0x30, 0x00, 0xD1]);
        // Measurements that were on their way are no answer.
        assert!(answer(&mut setup, id::MT_DATA2, &[]).is_empty());
        let output = answer(&mut setup, 0x31, &[]);
        let expected = [
            0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF, 0xFF, 0x40, 0x20, 0x00, 0xFA, 0x80, 0x20,
            0x00, 0xFA,
        ];
        assert_eq!(output[4..20], expected);
        let mut granted = expected;
        granted[15] = 0xC8;
        let measure = answer(&mut setup, 0xC1, &granted);
        assert_eq!(measure, [0xFA, 0xFF, 0x10, 0x00, 0xF1]);
        assert!(answer(&mut setup, 0x11, &[]).is_empty());
        assert_eq!(setup.due_ns(), None);
        assert_eq!(setup.interval_ns(), 5_000_000);
        assert_eq!(setup.complaint(), "the device gives 200 Hz instead of 250");
    }

    #[test]
    fn an_error_is_said() {
        let mut setup = XsensSetup::new(100.0);
        setup.send(0).unwrap();
        answer(&mut setup, 0x31, &[]);
        answer(&mut setup, id::ERROR, &[3]);
        assert_eq!(setup.complaint(), "the device refuses message C0: error 3");
    }
}

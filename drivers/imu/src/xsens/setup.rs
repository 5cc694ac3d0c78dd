//! How an Xsens device is configured after each open: to its configuration state, set what is sent
//! and how often, to its measurement state.
//!
//! Source: MT0101P, GoToConfig, SetOutputConfiguration, GoToMeasurement.

use super::item::{ACCELERATION, PACKET_COUNTER, RATE_OF_TURN, SAMPLE_TIME_FINE};
use super::message::{Message, XsensFraming};
use super::protocol::{Ticks, reading};
use crate::Reading;
use crate::command_sequence::{self, CommandSequence};
use crate::protocol::{Codec, interval_ns};

/// Message identifiers.
pub mod id {
    /// To measuring.
    pub const GO_TO_MEASUREMENT: u8 = 0x10;
    /// To configuring.
    pub const GO_TO_CONFIG: u8 = 0x30;
    /// Measurements.
    pub const MT_DATA2: u8 = 0x36;
    /// One byte: why the device refuses a message.
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

/// A step of the setup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// To the configuration state.
    Config,
    /// What is sent, and how often.
    Output,
    /// To the measurement state.
    Measurement,
}

impl Step {
    fn message(self) -> u8 {
        match self {
            Self::Config => id::GO_TO_CONFIG,
            Self::Output => id::OUTPUT_CONFIGURATION,
            Self::Measurement => id::GO_TO_MEASUREMENT,
        }
    }
}

impl command_sequence::Step for Step {
    const FIRST: Self = Self::Config;

    fn next(self, _acknowledged: bool) -> Option<Self> {
        match self {
            Self::Config => Some(Self::Output),
            Self::Output => Some(Self::Measurement),
            Self::Measurement => None,
        }
    }
}

/// What Xbus messages mean, and how a device is configured.
#[derive(Debug)]
pub struct XsensCodec {
    rate_hz: u16,
    granted_hz: u16,
    ticks: Ticks,
}

impl Codec for XsensCodec {
    type Framing = XsensFraming;
    type Step = Step;

    /// The protocol has whole rates.
    fn new(rate_hz: f64) -> Self {
        let rate_hz = ((rate_hz + 0.5) as u16).max(1);
        Self {
            rate_hz,
            granted_hz: rate_hz,
            ticks: Ticks::default(),
        }
    }

    fn restart(&mut self) {
        self.ticks = Ticks::default();
    }

    fn command(&self, step: Step) -> Vec<u8> {
        let output = match step {
            Step::Output => self.output().concat(),
            Step::Config | Step::Measurement => Vec::new(),
        };
        Message::encode(step.message(), &output)
    }

    fn take(
        &mut self,
        frame: &[u8],
        commands: &mut CommandSequence<Step>,
        arrival_ns: i64,
    ) -> Option<Reading> {
        let message = Message::from_frame(frame)?;
        if message.id == id::MT_DATA2 {
            return reading(&message, arrival_ns, &mut self.ticks);
        }
        self.take_answer(&message, commands);
        None
    }

    fn interval_ns(&self) -> i64 {
        interval_ns(f64::from(self.granted_hz))
    }
}

impl XsensCodec {
    /// What is asked for: each item's identifier and rate, Hz.
    fn output(&self) -> [[u8; 4]; 4] {
        [
            (PACKET_COUNTER, WITH_EVERY_MESSAGE),
            (SAMPLE_TIME_FINE, WITH_EVERY_MESSAGE),
            (ACCELERATION, self.rate_hz),
            (RATE_OF_TURN, self.rate_hz),
        ]
        .map(|(item, rate)| {
            let ([item_high, item_low], [high, low]) = (item.to_be_bytes(), rate.to_be_bytes());
            [item_high, item_low, high, low]
        })
    }

    /// Takes a message that is not MTData2. It counts only where it has what an answer to the
    /// command that was sent must have: a device that was away during a step would else be taken
    /// to be configured.
    fn take_answer(&mut self, message: &Message<'_>, commands: &mut CommandSequence<Step>) {
        let Some(step) = commands.step() else {
            return;
        };
        let sent = step.message();
        match (step, message.data) {
            (_, [code]) if message.id == id::ERROR => commands.refuse(format!(
                "the device refuses message {sent:02X}: error {code}"
            )),
            _ if message.id != id::ack(sent) => {}
            (Step::Config | Step::Measurement, []) => commands.acknowledge(),
            (Step::Output, data) => {
                if let Some(granted_hz) = self.granted_hz(data) {
                    self.granted_hz = granted_hz;
                    if granted_hz != self.rate_hz {
                        commands.complain(format!(
                            "the device gives {granted_hz} Hz instead of {}",
                            self.rate_hz
                        ));
                    }
                    commands.acknowledge();
                }
            }
            _ => {}
        }
    }

    /// The rate in an answer to [`Step::Output`], which has items that were asked for and nothing
    /// else. A device sends at a divisor of its base rate, and answers which.
    fn granted_hz(&self, data: &[u8]) -> Option<u16> {
        let (items, rest) = data.as_chunks::<4>();
        let mut granted_hz = None;
        for [item_high, item_low, high, low] in items {
            let item = [*item_high, *item_low];
            if !self.output().iter().any(|asked| asked.starts_with(&item)) {
                return None;
            }
            if item == RATE_OF_TURN.to_be_bytes() {
                granted_hz = Some(u16::from_be_bytes([*high, *low]));
            }
        }
        granted_hz.filter(|hz| *hz > 0 && rest.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xsens::Xsens;

    fn answer(xsens: &mut Xsens, id: u8, data: &[u8]) -> Vec<u8> {
        xsens.take(&Message::encode(id, data), 0, &mut Vec::new());
        xsens.send(0).unwrap_or_default()
    }

    /// Bytes: ours, from MT0101P's tables; those without data as in einride/xsens-go.
    #[test]
    fn the_device_is_configured_step_by_step() {
        let mut xsens = Xsens::new(250.0);
        assert_eq!(xsens.send(0).unwrap(), [0xFA, 0xFF, 0x30, 0x00, 0xD1]);
        // Measurements that were on their way are no answer.
        assert!(answer(&mut xsens, id::MT_DATA2, &[]).is_empty());
        let output = answer(&mut xsens, 0x31, &[]);
        let expected = [
            0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF, 0xFF, 0x40, 0x20, 0x00, 0xFA, 0x80, 0x20,
            0x00, 0xFA,
        ];
        assert_eq!(output[4..20], expected);
        let mut granted = expected;
        granted[15] = 0xC8;
        let measure = answer(&mut xsens, 0xC1, &granted);
        assert_eq!(measure, [0xFA, 0xFF, 0x10, 0x00, 0xF1]);
        assert!(answer(&mut xsens, 0x11, &[]).is_empty());
        assert_eq!(xsens.due_ns(), None);
        assert_eq!(xsens.interval_ns(), 5_000_000);
        assert_eq!(xsens.complaint(), "the device gives 200 Hz instead of 250");
    }

    #[test]
    fn an_error_is_reported() {
        let mut xsens = Xsens::new(100.0);
        xsens.send(0).unwrap();
        answer(&mut xsens, 0x31, &[]);
        answer(&mut xsens, id::ERROR, &[3]);
        assert_eq!(xsens.complaint(), "the device refuses message C0: error 3");
    }

    /// A device as the driver meets it in issue 16: silent at first, while answers that are not
    /// its own come by its port.
    #[derive(Default)]
    struct Device {
        measures: bool,
        hz: u16,
    }

    impl Device {
        fn answer(&mut self, command: &[u8]) -> Vec<u8> {
            let message = Message::from_frame(command).unwrap();
            match message.id {
                id::GO_TO_CONFIG => self.measures = false,
                id::GO_TO_MEASUREMENT => self.measures = true,
                id::OUTPUT_CONFIGURATION if !self.measures => {
                    let rate = message.data.last_chunk::<2>().unwrap();
                    self.hz = u16::from_be_bytes(*rate);
                }
                _ => return Message::encode(id::ERROR, &[4]),
            }
            Message::encode(id::ack(message.id), message.data)
        }
    }

    /// When the device measures as it is asked to, s after it begins to answer at 1.2 s; the port
    /// is never closed.
    fn configured_after_s(wrong: &[(i64, u8, &[u8])]) -> Option<f64> {
        let (mut xsens, mut device) = (Xsens::new(250.0), Device::default());
        let mut wrong = wrong.iter().peekable();
        for now_ms in 0..4000 {
            let now_ns = now_ms * 1_000_000;
            while let Some((_, id, data)) = wrong.next_if(|(at_ms, ..)| *at_ms <= now_ms) {
                xsens.take(&Message::encode(*id, data), now_ns, &mut Vec::new());
            }
            while let Some(command) = xsens.send(now_ns) {
                if now_ms >= 1200 {
                    let answer = device.answer(&command);
                    xsens.take(&answer, now_ns, &mut Vec::new());
                }
            }
            if device.measures && device.hz == 250 {
                return Some((now_ms - 1200) as f64 * 1e-3);
            }
        }
        None
    }

    /// The wrong answers of four of the seeds of tests/wrong_packets.rs that took over two
    /// seconds, before the device spoke: each of them ended the setup while nothing was
    /// configured.
    #[test]
    fn answers_that_are_not_its_own_end_no_step() {
        let (config, output, measurement) = (0x31, 0xC1, 0x11);
        let garbage: &[u8] = &[0x10, 0x20, 0x02, 7];
        for wrong in [
            &[
                (40, id::ERROR, garbage),
                (120, output, garbage),
                (160, measurement, garbage),
            ],
            &[
                (280, config, garbage),
                (360, id::ERROR, garbage),
                (440, measurement, garbage),
            ],
            &[
                (200, config, &[1]),
                (280, id::ERROR, garbage),
                (400, id::ERROR, garbage),
            ],
            &[
                (160, config, garbage),
                (680, output, garbage),
                (880, measurement, garbage),
            ],
            // As well-formed as they can be: the error's one byte, no data.
            &[
                (160, config, &[]),
                (280, id::ERROR, &[3]),
                (1190, id::ERROR, &[3]),
            ],
            &[
                (160, config, &[]),
                (280, id::ERROR, &[3]),
                (1190, measurement, &[]),
            ],
        ] {
            let after_s = configured_after_s(wrong);
            assert!(after_s.is_some_and(|s| s < 0.5), "{wrong:?}: {after_s:?}");
        }
    }

    #[test]
    fn a_device_that_never_answers_one_command_measures_all_the_same() {
        let (mut xsens, mut measures) = (Xsens::new(250.0), false);
        let mut now_ns = 0;
        while let Some(due_ns) = xsens.due_ns() {
            now_ns = now_ns.max(due_ns);
            let Some(command) = xsens.send(now_ns) else {
                continue;
            };
            let sent = Message::from_frame(&command).unwrap().id;
            if sent != id::OUTPUT_CONFIGURATION {
                measures = sent == id::GO_TO_MEASUREMENT;
                xsens.take(
                    &Message::encode(id::ack(sent), &[]),
                    now_ns,
                    &mut Vec::new(),
                );
            }
        }
        assert!(measures && now_ns < 3_000_000_000, "{now_ns}");
    }
}

//! How a MIP device is configured after each open: idle, ask its base rate, say what is sent and how often, resume.
//!
//! Source: 3DM-CV7 data communications protocol, commands (0x01,0x02), (0x01,0x06), (0x0C,0x0E), (0x0C,0x0F),
//! (0x0C,0x11).

use super::field::{ACCELERATION, RATE, REFERENCE_TIME, SENSOR_DATA};
use super::packet::Packet;
use crate::conversation::{Conversation, Turn};
use crate::protocol::interval_ns;

/// Commands and their descriptors.
pub mod command {
    /// Descriptor set of base commands.
    pub const BASE: u8 = 0x01;
    /// Base: stop all streams.
    pub const IDLE: u8 = 0x02;
    /// Base: stream again.
    pub const RESUME: u8 = 0x06;
    /// Descriptor set of 3DM commands.
    pub const DM: u8 = 0x0C;
    /// 3DM: how often a descriptor set is measured.
    pub const BASE_RATE: u8 = 0x0E;
    /// 3DM, reply: descriptor set, u16 Hz.
    pub const BASE_RATE_REPLY: u8 = 0x8E;
    /// 3DM: which fields are sent, each with its decimation.
    pub const MESSAGE_FORMAT: u8 = 0x0F;
    /// 3DM: switches a stream.
    pub const STREAM: u8 = 0x11;
    /// Any: echo of the command's descriptor, error code.
    pub const ACK: u8 = 0xF1;
    /// First byte of commands that set something.
    pub const WRITE: u8 = 0x01;
}

/// Measurements a second where the device does not say: what the 3DM-CV7 and GX5 have.
const BASE_HZ: u16 = 1000;
/// Base rates that are believed: one wrong answer must not make the device send what nobody asked for.
const BASE_HZ_MIN: u16 = 100;
/// The most of them.
const BASE_HZ_MAX: u16 = 10_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Idle,
    BaseRate,
    Format,
    /// Without the reference time, which older devices do not have.
    ShortFormat,
    Stream,
    Resume,
    Done,
}

impl Step {
    /// Set and descriptor of its command.
    fn command(self) -> Option<(u8, u8)> {
        Some(match self {
            Self::Idle => (command::BASE, command::IDLE),
            Self::BaseRate => (command::DM, command::BASE_RATE),
            Self::Format | Self::ShortFormat => (command::DM, command::MESSAGE_FORMAT),
            Self::Stream => (command::DM, command::STREAM),
            Self::Resume => (command::BASE, command::RESUME),
            Self::Done => return None,
        })
    }

    /// What follows, whether it was done, refused or not answered.
    fn next(self, done: bool) -> Self {
        match self {
            Self::Idle => Self::BaseRate,
            Self::BaseRate => Self::Format,
            Self::Format if !done => Self::ShortFormat,
            Self::Format | Self::ShortFormat => Self::Stream,
            Self::Stream => Self::Resume,
            Self::Resume | Self::Done => Self::Done,
        }
    }
}

/// Configures a device.
#[derive(Debug)]
pub struct MipSetup {
    rate_hz: f64,
    base_hz: u16,
    talk: Conversation<Step>,
    complaint: String,
}

impl MipSetup {
    /// For so many readings a second.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            base_hz: BASE_HZ,
            talk: Conversation::at(Step::Idle),
            complaint: String::new(),
        }
    }

    /// From the beginning.
    pub fn restart(&mut self) {
        self.talk = Conversation::at(Step::Idle);
        self.base_hz = BASE_HZ;
        self.complaint.clear();
    }

    /// The packet to send now.
    pub fn send(&mut self, now_ns: i64) -> Option<Vec<u8>> {
        loop {
            let (set, descriptor) = self.talk.step().command()?;
            match self.talk.turn(now_ns) {
                Turn::Wait => return None,
                Turn::GiveUp => self.go_on(false),
                Turn::Send => {
                    let data = self.data();
                    return Some(Packet::encode(set, &[(descriptor, &data)]));
                }
            }
        }
    }

    fn data(&self) -> Vec<u8> {
        let decimation = self.decimation().to_be_bytes();
        let fields: &[u8] = match self.talk.step() {
            Step::BaseRate => return vec![SENSOR_DATA],
            Step::Stream => return vec![command::WRITE, SENSOR_DATA, 1],
            Step::Format => &[REFERENCE_TIME, ACCELERATION, RATE],
            Step::ShortFormat => &[ACCELERATION, RATE],
            _ => return Vec::new(),
        };
        let mut data = vec![command::WRITE, SENSOR_DATA, fields.len() as u8];
        for field in fields {
            data.push(*field);
            data.extend(decimation);
        }
        data
    }

    /// Every how many measurements one is sent.
    fn decimation(&self) -> u16 {
        ((f64::from(self.base_hz) / self.rate_hz + 0.5) as u16).max(1)
    }

    /// From one reading to the next, ns.
    pub fn interval_ns(&self) -> i64 {
        interval_ns(f64::from(self.base_hz) / f64::from(self.decimation()))
    }

    /// Takes a packet that is not sensor data.
    pub fn take(&mut self, packet: &Packet<'_>) {
        let Some((set, descriptor)) = self.talk.step().command() else {
            return;
        };
        if packet.set != set {
            return;
        }
        for (field, data) in packet.fields() {
            match (field, data) {
                // It stands behind its acknowledgement, in the same packet.
                (command::BASE_RATE_REPLY, [SENSOR_DATA, h, l]) => {
                    let base_hz = u16::from_be_bytes([*h, *l]);
                    if (BASE_HZ_MIN..=BASE_HZ_MAX).contains(&base_hz) {
                        self.base_hz = base_hz;
                    }
                }
                (command::ACK, [echo, error]) if *echo == descriptor => {
                    if *error != 0 && self.talk.step() != Step::Format {
                        self.complaint = format!(
                            "the device refuses command {set:02X}/{descriptor:02X}: error {error}"
                        );
                    }
                    self.go_on(*error == 0);
                }
                _ => {}
            }
        }
    }

    fn go_on(&mut self, done: bool) {
        self.talk = Conversation::at(self.talk.step().next(done));
    }

    /// When there may be something to send.
    pub fn due_ns(&self) -> Option<i64> {
        (self.talk.step() != Step::Done).then_some(self.talk.due_ns())
    }

    /// What the device refused, or an empty text.
    pub fn complaint(&self) -> &str {
        &self.complaint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ack(set: u8, echo: u8, error: u8) -> Vec<u8> {
        Packet::encode(set, &[(command::ACK, &[echo, error])])
    }

    /// Answers to the last command; gives the next one.
    fn answer(setup: &mut MipSetup, reply: &[u8]) -> Vec<u8> {
        setup.take(&Packet::of(reply).unwrap());
        setup.send(0).unwrap_or_default()
    }

    /// Commands and replies of the base set: 3DM-GX5 data communications protocol, "Set To Idle" and "Resume". The
    /// others: ours, from the tables of the 3DM-CV7's.
    #[test]
    fn the_device_is_configured_step_by_step() {
        let mut setup = MipSetup::new(250.0);
        let idle = setup.send(0).unwrap();
        assert_eq!(idle, [0x75, 0x65, 0x01, 0x02, 0x02, 0x02, 0xE1, 0xC7]);
        assert_eq!(setup.send(1), None);
        let idle_ack = [0x75, 0x65, 0x01, 0x04, 0x04, 0xF1, 0x02, 0x00, 0xD6, 0x6C];
        assert_eq!(ack(1, 2, 0), idle_ack);
        let rate = answer(&mut setup, &idle_ack);
        assert_eq!(rate[2..7], [0x0C, 0x03, 0x03, 0x0E, 0x80]);
        let reply = Packet::encode(0x0C, &[(0xF1, &[0x0E, 0]), (0x8E, &[0x80, 0x01, 0xF4])]);
        let format = answer(&mut setup, &reply);
        // 500 Hz by two.
        assert_eq!(
            format[4..18],
            [0x0E, 0x0F, 1, 0x80, 3, 0xD5, 0, 2, 0x04, 0, 2, 0x05, 0, 2]
        );
        assert_eq!(setup.interval_ns(), 4_000_000);
        let stream = answer(&mut setup, &ack(0x0C, 0x0F, 0));
        assert_eq!(stream[4..9], [0x05, 0x11, 1, 0x80, 1]);
        let resume = answer(&mut setup, &ack(0x0C, 0x11, 0));
        assert_eq!(resume, [0x75, 0x65, 0x01, 0x02, 0x02, 0x06, 0xE5, 0xCB]);
        assert!(answer(&mut setup, &ack(1, 6, 0)).is_empty());
        assert_eq!((setup.due_ns(), setup.complaint()), (None, ""));
    }

    #[test]
    fn a_base_rate_that_no_device_has_is_not_believed() {
        for wrong_hz in [0_u16, 1, 99, 10_001, u16::MAX] {
            let mut setup = MipSetup::new(250.0);
            setup.send(0).unwrap();
            answer(&mut setup, &ack(1, 2, 0));
            let [high, low] = wrong_hz.to_be_bytes();
            let fields: [(u8, &[u8]); 2] = [(0xF1, &[0x0E, 0]), (0x8E, &[0x80, high, low])];
            answer(&mut setup, &Packet::encode(0x0C, &fields));
            assert_eq!(setup.interval_ns(), 4_000_000, "{wrong_hz} Hz");
        }
    }

    #[test]
    fn an_older_device_sends_without_reference_time() {
        let mut setup = MipSetup::new(100.0);
        setup.send(0).unwrap();
        answer(&mut setup, &ack(1, 2, 0));
        answer(&mut setup, &ack(0x0C, 0x0E, 0));
        let short = answer(&mut setup, &ack(0x0C, 0x0F, 3));
        assert_eq!(short[6..15], [1, 0x80, 2, 0x04, 0, 10, 0x05, 0, 10]);
        assert_eq!(setup.complaint(), "");
        answer(&mut setup, &ack(0x0C, 0x0F, 3));
        assert_eq!(
            setup.complaint(),
            "the device refuses command 0C/0F: error 3"
        );
    }

    #[test]
    fn a_device_that_answers_nothing_is_let_alone_after_a_while() {
        let mut setup = MipSetup::new(100.0);
        let (mut sent, mut now_ns) = (0, 0);
        while let Some(due_ns) = setup.due_ns() {
            now_ns = now_ns.max(due_ns);
            sent += u32::from(setup.send(now_ns).is_some());
            assert!(now_ns < 10_000_000_000);
        }
        assert_eq!(sent, 18);
    }
}

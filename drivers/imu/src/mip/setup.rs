//! How a MIP device is configured after each open: idle, ask its base rate, set what is sent and
//! how often, resume.
//!
//! Source: 3DM-CV7 data communications protocol, commands (0x01,0x02), (0x01,0x06), (0x0C,0x0E),
//! (0x0C,0x0F), (0x0C,0x11).

use super::field::{ACCELERATION, RATE, REFERENCE_TIME, SENSOR_DATA};
use super::packet::{MipFraming, Packet};
use super::protocol::reading;
use crate::Reading;
use crate::command_sequence::{self, CommandSequence};
use crate::protocol::{Codec, interval_ns};

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

/// Measurements a second where the device does not answer: what the 3DM-CV7 and GX5 have.
const BASE_HZ: u16 = 1000;
/// Plausible base rates: one wrong answer must not make the device send at a rate that was not
/// asked for.
const BASE_HZ_MIN: u16 = 100;
/// The most of them.
const BASE_HZ_MAX: u16 = 10_000;

/// A step of the setup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing is streamed.
    Idle,
    /// How often it measures.
    BaseRate,
    /// What is sent, and how often.
    Format,
    /// The same without the reference time, which older devices do not have.
    ShortFormat,
    /// The stream is switched on.
    Stream,
    /// What is switched on is streamed.
    Resume,
}

impl Step {
    /// Set and descriptor of its command.
    fn command(self) -> (u8, u8) {
        match self {
            Self::Idle => (command::BASE, command::IDLE),
            Self::BaseRate => (command::DM, command::BASE_RATE),
            Self::Format | Self::ShortFormat => (command::DM, command::MESSAGE_FORMAT),
            Self::Stream => (command::DM, command::STREAM),
            Self::Resume => (command::BASE, command::RESUME),
        }
    }
}

impl command_sequence::Step for Step {
    const FIRST: Self = Self::Idle;

    fn next(self, acknowledged: bool) -> Option<Self> {
        match self {
            Self::Idle => Some(Self::BaseRate),
            Self::BaseRate => Some(Self::Format),
            Self::Format if !acknowledged => Some(Self::ShortFormat),
            Self::Format | Self::ShortFormat => Some(Self::Stream),
            Self::Stream => Some(Self::Resume),
            Self::Resume => None,
        }
    }
}

/// What MIP's packets mean, and how a device is configured.
#[derive(Debug)]
pub struct MipCodec {
    rate_hz: f64,
    base_hz: u16,
}

impl Codec for MipCodec {
    type Framing = MipFraming;
    type Step = Step;

    fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            base_hz: BASE_HZ,
        }
    }

    fn restart(&mut self) {
        self.base_hz = BASE_HZ;
    }

    fn command(&self, step: Step) -> Vec<u8> {
        let (set, descriptor) = step.command();
        Packet::encode(set, &[(descriptor, &self.data(step))])
    }

    fn take(
        &mut self,
        frame: &[u8],
        commands: &mut CommandSequence<Step>,
        arrival_ns: i64,
    ) -> Option<Reading> {
        let packet = Packet::from_frame(frame)?;
        if packet.set == SENSOR_DATA {
            return reading(&packet, arrival_ns);
        }
        self.take_answer(&packet, commands);
        None
    }

    fn interval_ns(&self) -> i64 {
        interval_ns(f64::from(self.base_hz) / f64::from(self.decimation()))
    }
}

impl MipCodec {
    fn data(&self, step: Step) -> Vec<u8> {
        let decimation = self.decimation().to_be_bytes();
        let fields: &[u8] = match step {
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

    /// Takes a packet that is not sensor data. It counts only where it echoes the command that was
    /// sent.
    fn take_answer(&mut self, packet: &Packet<'_>, commands: &mut CommandSequence<Step>) {
        for (field, data) in packet.fields() {
            let Some(step) = commands.step() else {
                return;
            };
            let (set, descriptor) = step.command();
            match (field, data) {
                _ if packet.set != set => {}
                // It stands behind its acknowledgement, in the same packet.
                (command::BASE_RATE_REPLY, [SENSOR_DATA, h, l]) => {
                    let base_hz = u16::from_be_bytes([*h, *l]);
                    if (BASE_HZ_MIN..=BASE_HZ_MAX).contains(&base_hz) {
                        self.base_hz = base_hz;
                    }
                }
                (command::ACK, [echo, 0]) if *echo == descriptor => commands.acknowledge(),
                (command::ACK, [echo, _]) if *echo == descriptor && step == Step::Format => {
                    commands.replace();
                }
                (command::ACK, [echo, error]) if *echo == descriptor => commands.refuse(format!(
                    "the device refuses command {set:02X}/{descriptor:02X}: error {error}"
                )),
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mip::Mip;

    fn ack(set: u8, echo: u8, error: u8) -> Vec<u8> {
        Packet::encode(set, &[(command::ACK, &[echo, error])])
    }

    /// Answers to the last command; gives the next one.
    fn answer(mip: &mut Mip, reply: &[u8]) -> Vec<u8> {
        mip.take(reply, 0, &mut Vec::new());
        mip.send(0).unwrap_or_default()
    }

    /// Commands and replies of the base set: 3DM-GX5 data communications protocol, "Set To Idle"
    /// and "Resume". The others: ours, from the tables of the 3DM-CV7's.
    #[test]
    fn the_device_is_configured_step_by_step() {
        let mut mip = Mip::new(250.0);
        let idle = mip.send(0).unwrap();
        assert_eq!(idle, [0x75, 0x65, 0x01, 0x02, 0x02, 0x02, 0xE1, 0xC7]);
        assert_eq!(mip.send(1), None);
        let idle_ack = [0x75, 0x65, 0x01, 0x04, 0x04, 0xF1, 0x02, 0x00, 0xD6, 0x6C];
        assert_eq!(ack(1, 2, 0), idle_ack);
        let rate = answer(&mut mip, &idle_ack);
        assert_eq!(rate[2..7], [0x0C, 0x03, 0x03, 0x0E, 0x80]);
        let reply = Packet::encode(0x0C, &[(0xF1, &[0x0E, 0]), (0x8E, &[0x80, 0x01, 0xF4])]);
        let format = answer(&mut mip, &reply);
        // 500 Hz by two.
        assert_eq!(
            format[4..18],
            [0x0E, 0x0F, 1, 0x80, 3, 0xD5, 0, 2, 0x04, 0, 2, 0x05, 0, 2]
        );
        assert_eq!(mip.interval_ns(), 4_000_000);
        let stream = answer(&mut mip, &ack(0x0C, 0x0F, 0));
        assert_eq!(stream[4..9], [0x05, 0x11, 1, 0x80, 1]);
        let resume = answer(&mut mip, &ack(0x0C, 0x11, 0));
        assert_eq!(resume, [0x75, 0x65, 0x01, 0x02, 0x02, 0x06, 0xE5, 0xCB]);
        assert!(answer(&mut mip, &ack(1, 6, 0)).is_empty());
        assert_eq!((mip.due_ns(), mip.complaint()), (None, ""));
    }

    #[test]
    fn a_base_rate_that_no_device_has_is_not_believed() {
        for wrong_hz in [0_u16, 1, 99, 10_001, u16::MAX] {
            let mut mip = Mip::new(250.0);
            mip.send(0).unwrap();
            answer(&mut mip, &ack(1, 2, 0));
            let [high, low] = wrong_hz.to_be_bytes();
            let fields: [(u8, &[u8]); 2] = [(0xF1, &[0x0E, 0]), (0x8E, &[0x80, high, low])];
            answer(&mut mip, &Packet::encode(0x0C, &fields));
            assert_eq!(mip.interval_ns(), 4_000_000, "{wrong_hz} Hz");
        }
    }

    #[test]
    fn an_older_device_sends_without_reference_time() {
        let mut mip = Mip::new(100.0);
        mip.send(0).unwrap();
        answer(&mut mip, &ack(1, 2, 0));
        answer(&mut mip, &ack(0x0C, 0x0E, 0));
        let short = answer(&mut mip, &ack(0x0C, 0x0F, 3));
        assert_eq!(short[6..15], [1, 0x80, 2, 0x04, 0, 10, 0x05, 0, 10]);
        assert_eq!(mip.complaint(), "");
        answer(&mut mip, &ack(0x0C, 0x0F, 3));
        assert_eq!(mip.complaint(), "the device refuses command 0C/0F: error 3");
    }

    #[test]
    fn a_device_that_answers_nothing_is_let_alone_after_a_while() {
        let mut mip = Mip::new(100.0);
        let (mut sent, mut now_ns) = (0, 0);
        while let Some(due_ns) = mip.due_ns() {
            now_ns = now_ns.max(due_ns);
            sent += u32::from(mip.send(now_ns).is_some());
            assert!(now_ns < 10_000_000_000);
        }
        assert_eq!(sent, 18);
    }
}

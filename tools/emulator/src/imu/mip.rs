//! A MicroStrain device.

use super::ImuMeasurement;
use super::device::{Device, is_asked_for};
use crate::wrong_content::WrongContent;
use randt_imu::STANDARD_GRAVITY_M_S2;
use randt_imu::frames::Frames;
use randt_imu::mip::{Field, MipFraming, Packet, SENSOR_DATA, command};

/// Measurements a second before decimation.
const BASE_HZ: u16 = 1000;
/// "Unknown command", as the vendor numbers it.
const UNKNOWN_COMMAND: u8 = 1;

/// The device as it was configured.
#[derive(Debug, Default)]
pub(super) struct MipDevice {
    frames: Frames<MipFraming>,
    state: State,
}

#[derive(Debug, Default)]
struct State {
    streams: bool,
    decimation: u16,
    fields: Vec<u8>,
}

impl State {
    /// Carries a command out; gives the answer's fields.
    fn carry_out(&mut self, set: u8, descriptor: u8, data: &[u8]) -> Vec<(u8, Vec<u8>)> {
        let mut more = None;
        let mut error = 0;
        match (set, descriptor, data) {
            (command::BASE, command::IDLE, _) => self.streams = false,
            (command::BASE, command::RESUME, _) => self.streams = true,
            (command::DM, command::BASE_RATE, [SENSOR_DATA]) => {
                let [high, low] = BASE_HZ.to_be_bytes();
                more = Some((command::BASE_RATE_REPLY, vec![SENSOR_DATA, high, low]));
            }
            (command::DM, command::STREAM, [command::WRITE, SENSOR_DATA, _]) => {}
            (
                command::DM,
                command::MESSAGE_FORMAT,
                [command::WRITE, SENSOR_DATA, _, fields @ ..],
            ) => {
                self.fields.clear();
                for [field, high, low] in fields.as_chunks().0 {
                    self.fields.push(*field);
                    self.decimation = u16::from_be_bytes([*high, *low]);
                }
            }
            _ => error = UNKNOWN_COMMAND,
        }
        let mut answer = vec![(command::ACK, vec![descriptor, error])];
        answer.extend(more);
        answer
    }
}

impl Device for MipDevice {
    fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        let state = &mut self.state;
        let mut answers = Vec::new();
        self.frames.push(bytes, &mut |frame| {
            let Some(packet) = Packet::from_frame(frame) else {
                return;
            };
            let mut fields = Vec::new();
            for (descriptor, data) in packet.fields() {
                fields.extend(state.carry_out(packet.set, descriptor, data));
            }
            answers.extend(encode(packet.set, &fields));
        });
        answers
    }

    fn message(&self, measurement: &ImuMeasurement, interval_ns: i64) -> Option<Vec<u8>> {
        let asked_ns = i64::from(self.state.decimation) * 1_000_000_000 / i64::from(BASE_HZ);
        if !self.state.streams || !is_asked_for(measurement, interval_ns, asked_ns) {
            return None;
        }
        let fields: Vec<(u8, Vec<u8>)> = measured(measurement)
            .into_iter()
            .filter(|(descriptor, _)| self.state.fields.contains(descriptor))
            .collect();
        Some(encode(SENSOR_DATA, &fields))
    }

    fn wrong(&self, measurement: &ImuMeasurement, wrong: &mut WrongContent) -> Vec<u8> {
        if wrong.below(3) > 0 {
            let mut fields = measured(measurement).to_vec();
            let at = wrong.below(fields.len() as u64) as usize;
            if let Some((_, data)) = fields.get_mut(at) {
                wrong.change(data);
            }
            return encode(SENSOR_DATA, &fields);
        }
        // An answer without a question.
        let set = [command::BASE, command::DM][wrong.below(2) as usize];
        let echoes = [
            command::IDLE,
            command::RESUME,
            command::BASE_RATE,
            command::MESSAGE_FORMAT,
            command::STREAM,
        ];
        let echo = echoes[wrong.below(echoes.len() as u64) as usize];
        let (high, low) = (wrong.below(256) as u8, wrong.below(256) as u8);
        let fields = [
            (command::ACK, vec![echo, wrong.below(4) as u8]),
            (command::BASE_RATE_REPLY, vec![SENSOR_DATA, high, low]),
        ];
        encode(set, &fields)
    }

    fn oversize(&self) -> &'static [u8] {
        &[0x75, 0x65, SENSOR_DATA, 0xFF]
    }
}

/// All that is measured, as fields.
fn measured(measurement: &ImuMeasurement) -> [(u8, Vec<u8>); 3] {
    let acceleration = measurement
        .acceleration_m_s2
        .map(|value| (value / STANDARD_GRAVITY_M_S2) as f32);
    let fields = [
        Field::ReferenceTime(measurement.device_ns.unsigned_abs()),
        Field::Acceleration(acceleration),
        Field::Rate(measurement.rate_rad_s.map(|value| value as f32)),
    ];
    fields.map(|field| field.encode())
}

fn encode(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let fields: Vec<(u8, &[u8])> = fields.iter().map(|(d, data)| (*d, &data[..])).collect();
    Packet::encode(set, &fields)
}

//! An Xsens device.

use super::ImuMeasurement;
use super::device::{Device, is_asked_for};
use crate::wrong_content::WrongContent;
use randt_imu::frames::Frames;
use randt_imu::xsens::{Item, Message, XsensFraming, id};

/// Unit of its time.
const TICK_NS: i64 = 100_000;
/// "Message not supported in this state", as the vendor numbers it.
const INVALID_MESSAGE: u8 = 4;

/// The device as it was configured.
#[derive(Debug, Default)]
pub(super) struct XsensDevice {
    frames: Frames<XsensFraming>,
    measures: bool,
    rate_hz: u16,
}

impl Device for XsensDevice {
    fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answers = Vec::new();
        let (measures, rate_hz) = (&mut self.measures, &mut self.rate_hz);
        self.frames.push(bytes, &mut |frame| {
            let Some(message) = Message::from_frame(frame) else {
                return;
            };
            let answer = match message.id {
                id::GO_TO_CONFIG => {
                    *measures = false;
                    Message::encode(id::ack(message.id), &[])
                }
                id::GO_TO_MEASUREMENT => {
                    *measures = true;
                    Message::encode(id::ack(message.id), &[])
                }
                id::OUTPUT_CONFIGURATION if !*measures => {
                    for [_, _, high, low] in message.data.as_chunks().0 {
                        *rate_hz = u16::from_be_bytes([*high, *low]);
                    }
                    Message::encode(id::ack(message.id), message.data)
                }
                _ => Message::encode(id::ERROR, &[INVALID_MESSAGE]),
            };
            answers.extend(answer);
        });
        answers
    }

    fn message(&self, measurement: &ImuMeasurement, interval_ns: i64) -> Option<Vec<u8>> {
        let asked_ns = 1_000_000_000 / i64::from(self.rate_hz.max(1));
        if !self.measures || !is_asked_for(measurement, interval_ns, asked_ns) {
            return None;
        }
        Some(Message::encode(id::MT_DATA2, &measured(measurement)))
    }

    fn wrong(&self, measurement: &ImuMeasurement, wrong: &mut WrongContent) -> Vec<u8> {
        let mut data = measured(measurement);
        if wrong.below(3) > 0 {
            wrong.change(&mut data);
            return Message::encode(id::MT_DATA2, &data);
        }
        // An answer without a question.
        let asked = [
            id::GO_TO_CONFIG,
            id::OUTPUT_CONFIGURATION,
            id::GO_TO_MEASUREMENT,
        ];
        let answer = match asked.get(wrong.below(4) as usize) {
            Some(asked) => id::ack(*asked),
            None => id::ERROR,
        };
        data.truncate(wrong.below(12) as usize);
        wrong.change(&mut data);
        Message::encode(answer, &data)
    }

    fn oversize(&self) -> &'static [u8] {
        &[0xFA, 0xFF, id::MT_DATA2, 0xFF, 0xFF, 0xFF]
    }
}
/// All that is measured, as items.
fn measured(measurement: &ImuMeasurement) -> Vec<u8> {
    let mut data = Vec::new();
    for item in [
        Item::PacketCounter(measurement.number as u16),
        Item::SampleTimeFine((measurement.device_ns / TICK_NS) as u32),
        Item::Acceleration(measurement.acceleration_m_s2.map(|value| value as f32)),
        Item::RateOfTurn(measurement.rate_rad_s.map(|value| value as f32)),
    ] {
        item.encode(&mut data);
    }
    data
}

//! The items of MTData2 that this driver reads.
//!
//! Source: MT0101P, "MTData2", data identifiers. Coordinate system (bits 2, 3) and number format
//! (bits 0, 1) are those that the driver asks for: the sensor's own, single precision.

use crate::bytes::{array, float_bytes, floats};

/// Number of the message, u16.
pub const PACKET_COUNTER: u16 = 0x1020;
/// Time of the sample, u32, 0.1 ms.
pub const SAMPLE_TIME_FINE: u16 = 0x1060;
/// Specific force, m/s^2.
pub const ACCELERATION: u16 = 0x4020;
/// Angular rate, rad/s.
pub const RATE_OF_TURN: u16 = 0x8020;

/// One item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Item {
    /// Number of the message; begins anew after 65,535.
    PacketCounter(u16),
    /// Time of the sample, 0.1 ms; begins anew after 2^32.
    SampleTimeFine(u32),
    /// Specific force, m/s^2.
    Acceleration([f32; 3]),
    /// Angular rate, rad/s.
    RateOfTurn([f32; 3]),
}

impl Item {
    /// Reads an item; none where it is another one, or of the wrong length.
    pub fn decode(id: u16, data: &[u8]) -> Option<Self> {
        match id {
            PACKET_COUNTER if data.len() == 2 => {
                array(data).map(|bytes| Self::PacketCounter(u16::from_be_bytes(bytes)))
            }
            SAMPLE_TIME_FINE if data.len() == 4 => {
                array(data).map(|bytes| Self::SampleTimeFine(u32::from_be_bytes(bytes)))
            }
            ACCELERATION => floats(data).map(Self::Acceleration),
            RATE_OF_TURN => floats(data).map(Self::RateOfTurn),
            _ => None,
        }
    }

    /// Appends its bytes.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        let (id, data) = match self {
            Self::PacketCounter(count) => (PACKET_COUNTER, count.to_be_bytes().to_vec()),
            Self::SampleTimeFine(time) => (SAMPLE_TIME_FINE, time.to_be_bytes().to_vec()),
            Self::Acceleration(values) => (ACCELERATION, float_bytes(values)),
            Self::RateOfTurn(values) => (RATE_OF_TURN, float_bytes(values)),
        };
        bytes.extend(id.to_be_bytes());
        bytes.push(data.len() as u8);
        bytes.extend(data);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xsens::Message;
    use proptest::prelude::*;

    fn item() -> impl Strategy<Value = Item> {
        let three = || prop::array::uniform3(-1e9_f32..1e9);
        prop_oneof![
            any::<u16>().prop_map(Item::PacketCounter),
            any::<u32>().prop_map(Item::SampleTimeFine),
            three().prop_map(Item::Acceleration),
            three().prop_map(Item::RateOfTurn),
        ]
    }

    proptest! {
        #[test]
        fn items_are_read_back(items in prop::collection::vec(item(), 0..20)) {
            let mut data = Vec::new();
            for item in &items {
                item.encode(&mut data);
            }
            let message = Message { id: 0x36, data: &data };
            let read: Vec<Item> = message.items().filter_map(|(id, data)| Item::decode(id, data)).collect();
            prop_assert_eq!(read, items);
        }
    }
}

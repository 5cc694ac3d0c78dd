//! The fields of sensor data (descriptor set 0x80) that this driver reads.
//!
//! Source: 3DM-CV7 data communications protocol, "Sensor Data" and "Shared Data"; the vendor's MIP
//! SDK, `data_sensor` and `data_shared`.

use crate::bytes::{array, float_bytes, floats};

/// Descriptor set of sensor data.
pub const SENSOR_DATA: u8 = 0x80;
pub(crate) const ACCELERATION: u8 = 0x04;
pub(crate) const RATE: u8 = 0x05;
pub(crate) const REFERENCE_TIME: u8 = 0xD5;
const GPS_TIME: u8 = 0xD3;

/// A week, s.
const WEEK_S: f64 = 604_800.0;

/// The time of GPS, where the device knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpsTime {
    /// Seconds of the week.
    pub time_of_week_s: f64,
    /// Week since 1980.
    pub week: u16,
    /// Bit 0: the time of the week is good; bit 1: the week is.
    pub valid: u16,
}

impl GpsTime {
    /// As nanoseconds, where both parts are good.
    pub fn time_ns(&self) -> Option<i64> {
        let sane = (0.0..=WEEK_S).contains(&self.time_of_week_s);
        let seconds = f64::from(self.week) * WEEK_S;
        (self.valid & 3 == 3 && sane).then(|| {
            // Whole seconds apart from their fraction: together they have more digits than a
            // float.
            let whole = self.time_of_week_s.trunc();
            let fraction_ns = (self.time_of_week_s - whole) * 1e9;
            (seconds + whole) as i64 * 1_000_000_000 + fraction_ns as i64
        })
    }
}

/// One field of sensor data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field {
    /// Specific force, g.
    Acceleration([f32; 3]),
    /// Angular rate, rad/s.
    Rate([f32; 3]),
    /// The device's own time, ns.
    ReferenceTime(u64),
    /// Time of GPS.
    Gps(GpsTime),
}

impl Field {
    /// Reads a field; none where it is another one, or of the wrong length.
    pub fn decode(descriptor: u8, data: &[u8]) -> Option<Self> {
        match descriptor {
            ACCELERATION => floats(data).map(Self::Acceleration),
            RATE => floats(data).map(Self::Rate),
            REFERENCE_TIME => {
                let bytes = data.try_into().ok()?;
                Some(Self::ReferenceTime(u64::from_be_bytes(bytes)))
            }
            GPS_TIME => {
                let [rest @ .., v0, v1] = array::<12>(data).filter(|_| data.len() == 12)?;
                let [time @ .., w0, w1] = rest;
                Some(Self::Gps(GpsTime {
                    time_of_week_s: f64::from_be_bytes(time),
                    week: u16::from_be_bytes([w0, w1]),
                    valid: u16::from_be_bytes([v0, v1]),
                }))
            }
            _ => None,
        }
    }

    /// Its descriptor and its data.
    pub fn encode(&self) -> (u8, Vec<u8>) {
        match self {
            Self::Acceleration(values) => (ACCELERATION, float_bytes(values)),
            Self::Rate(values) => (RATE, float_bytes(values)),
            Self::ReferenceTime(time_ns) => (REFERENCE_TIME, time_ns.to_be_bytes().to_vec()),
            Self::Gps(gps) => {
                let mut data = gps.time_of_week_s.to_be_bytes().to_vec();
                data.extend(gps.week.to_be_bytes());
                data.extend(gps.valid.to_be_bytes());
                (GPS_TIME, data)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mip::{Packet, packet};
    use proptest::prelude::*;

    /// LORD-MicroStrain/mip_sdk, examples/cpp/mip_packet: a packet as a device sent it.
    const SDK: &[u8] = &[
        0x75, 0x65, 0x80, 0x4c, 0x0a, 0xd5, 0x00, 0x00, 0x00, 0x05, 0x5e, 0xe6, 0x7c, 0xc0, 0x0a,
        0xd6, 0x00, 0x00, 0x00, 0x01, 0x4e, 0x43, 0x4a, 0x00, 0x0e, 0x04, 0x3d, 0x9e, 0xe8, 0x8d,
        0x38, 0x7f, 0xdb, 0x00, 0xbf, 0x7a, 0xaf, 0x03, 0x0e, 0x05, 0xbb, 0x0c, 0x1e, 0x30, 0xbb,
        0x57, 0x2e, 0x68, 0xbb, 0xaa, 0x24, 0xae, 0x0e, 0x07, 0xbc, 0x8a, 0xac, 0x80, 0xbc, 0x72,
        0xc5, 0x0e, 0xbc, 0xc4, 0xe2, 0xc1, 0x0e, 0x08, 0x3e, 0xee, 0x3d, 0x9f, 0xbd, 0x66, 0xda,
        0xdd, 0xc0, 0xaf, 0xde, 0xf5, 0x91, 0x96,
    ];

    #[test]
    fn a_packet_of_the_vendors_kit_both_directions() {
        let packet = Packet::from_frame(SDK).unwrap();
        let known: Vec<Field> = packet
            .fields()
            .filter_map(|(descriptor, data)| Field::decode(descriptor, data))
            .collect();
        assert_eq!(known[0], Field::ReferenceTime(0x5_5ee6_7cc0));
        // A tenth of an hour after power-up, lying on its back: gravity is on -z.
        let Field::Acceleration(acceleration) = known[1] else {
            panic!("{known:?}")
        };
        assert!((acceleration[2] + 0.979).abs() < 0.001);
        let Field::Rate(rate) = known[2] else {
            panic!("{known:?}")
        };
        assert!(rate.iter().all(|rate| rate.abs() < 0.01));
        let fields: Vec<(u8, &[u8])> = packet.fields().collect();
        for field in known {
            let (descriptor, data) = field.encode();
            assert!(fields.contains(&(descriptor, &data[..])));
        }
        assert_eq!(Packet::encode(0x80, &fields), SDK);
        assert_eq!(packet::checksum(&SDK[..80]), [0x91, 0x96]);
    }

    #[test]
    fn gps_time_counts_only_where_it_is_valid() {
        let mut gps = GpsTime {
            time_of_week_s: 345_600.25,
            week: 2300,
            valid: 3,
        };
        assert_eq!(
            gps.time_ns(),
            Some((2300 * 604_800 + 345_600) * 1_000_000_000 + 250_000_000)
        );
        gps.valid = 1;
        assert_eq!(gps.time_ns(), None);
        (gps.valid, gps.time_of_week_s) = (3, f64::NAN);
        assert_eq!(gps.time_ns(), None);
    }

    fn field() -> impl Strategy<Value = Field> {
        let three = || prop::array::uniform3(-1e9_f32..1e9);
        prop_oneof![
            three().prop_map(Field::Acceleration),
            three().prop_map(Field::Rate),
            any::<u64>().prop_map(Field::ReferenceTime),
            (0.0..604_800.0, any::<u16>(), any::<u16>()).prop_map(
                |(time_of_week_s, week, valid)| {
                    Field::Gps(GpsTime {
                        time_of_week_s,
                        week,
                        valid,
                    })
                }
            ),
        ]
    }

    proptest! {
        #[test]
        fn fields_are_read_back(field in field(), short in 0_usize..8) {
            let (descriptor, data) = field.encode();
            prop_assert_eq!(Field::decode(descriptor, &data), Some(field));
            prop_assert_eq!(Field::decode(descriptor, &data[..short]), None);
        }
    }
}

//! MIP as a serial protocol: packets to readings.

use super::{Field, MipCodec, Packet};
use crate::protocol::Framed;
use crate::reading::{Reading, STANDARD_GRAVITY_M_S2};

/// A MicroStrain device.
pub type Mip = Framed<MipCodec>;

/// A packet of sensor data as a reading; none where rate or acceleration is not in it.
pub(super) fn reading(packet: &Packet<'_>, arrival_ns: i64) -> Option<Reading> {
    let (mut rate, mut acceleration, mut reference_ns, mut gps_ns) = (None, None, None, None);
    for (descriptor, data) in packet.fields() {
        match Field::decode(descriptor, data) {
            Some(Field::Rate(values)) => rate = Some(values),
            Some(Field::Acceleration(values)) => acceleration = Some(values),
            Some(Field::ReferenceTime(time_ns)) => reference_ns = i64::try_from(time_ns).ok(),
            Some(Field::Gps(gps)) => gps_ns = gps.time_ns(),
            _ => {}
        }
    }
    Some(Reading {
        // The device's own time is never set; that of GPS is, when it is first received.
        device_ns: reference_ns.or(gps_ns),
        counter: None,
        arrival_ns,
        rate_rad_s: rate?.map(f64::from),
        acceleration_m_s2: acceleration?.map(|value| f64::from(value) * STANDARD_GRAVITY_M_S2),
    })
}

#[cfg(test)]
mod tests {
    use super::super::SENSOR_DATA;
    use super::*;

    #[test]
    fn a_packet_is_a_reading_in_si_units() {
        let fields = [
            Field::ReferenceTime(5_000_000_000).encode(),
            Field::Acceleration([0.0, 0.5, 1.0]).encode(),
            Field::Rate([0.25, 0.0, -1.0]).encode(),
        ];
        let fields: Vec<(u8, &[u8])> = fields.iter().map(|(d, data)| (*d, &data[..])).collect();
        let bytes = Packet::encode(SENSOR_DATA, &fields);
        let mut mip = Mip::new(250.0);
        let mut readings = Vec::new();
        mip.take(&bytes, 7, &mut readings);
        let expected = Reading {
            device_ns: Some(5_000_000_000),
            counter: None,
            arrival_ns: 7,
            rate_rad_s: [0.25, 0.0, -1.0],
            acceleration_m_s2: [0.0, 4.903_325, 9.806_65],
        };
        assert_eq!(readings, [expected]);
        // Gravity alone is no reading.
        mip.take(&Packet::encode(SENSOR_DATA, &fields[..2]), 8, &mut readings);
        assert_eq!((readings.len(), mip.counts().frames), (1, 2));
    }
}

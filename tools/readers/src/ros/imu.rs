//! `sensor_msgs/Imu`.

use super::wire::{Encoding, Malformed, RosHeader, Wire};

/// Rates and specific force; an orientation is another program's estimate and not used.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RosImu {
    pub header: RosHeader,
    pub rate_rad_s: [f64; 3],
    pub acceleration_m_s2: [f64; 3],
}

impl RosImu {
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        wire.f64s::<4>()?; // orientation
        wire.f64s::<9>()?; // its covariance
        let rate_rad_s = wire.f64s()?;
        wire.f64s::<9>()?;
        let acceleration_m_s2 = wire.f64s()?;
        Ok(Self {
            header,
            rate_rad_s,
            acceleration_m_s2,
        })
    }
}

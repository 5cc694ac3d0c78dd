//! What a source yields: one reading in SI units, in the device's own axes.

/// Standard gravity, m/s^2: devices that give g mean this.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// One reading of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// The device's own time, ns, where it tells it; its zero is arbitrary, and it may begin anew.
    pub device_ns: Option<i64>,
    /// The device's number of the reading, where it has one; 16 bits, then it begins anew.
    pub counter: Option<u16>,
    /// When it reached the host, ns.
    pub arrival_ns: i64,
    /// Angular rate about the device's x, y, z, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Specific force along the device's x, y, z, m/s^2.
    pub acceleration_m_s2: [f64; 3],
}

impl Reading {
    /// Whether every value is a number: a device may send others when it is not ready.
    pub fn known(&self) -> bool {
        // 1e300 is how libphidget22 says "unknown"; no gyro and no accelerometer measures a thousandth of it.
        let known = |value: &f64| value.abs() < 1e6;
        self.rate_rad_s.iter().all(known) && self.acceleration_m_s2.iter().all(known)
    }
}

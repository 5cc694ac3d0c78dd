//! What a source yields: one reading in SI units, in the device's own axes.

/// Standard gravity, m/s^2: devices that give g mean this.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// No gyro of a robot measures more, rad/s: 5,700 degrees a second. Odometry takes no more either.
const RATE_MAX_RAD_S: f64 = 100.0;
/// No accelerometer of a robot measures more, m/s^2: 200 g.
const ACCELERATION_MAX_M_S2: f64 = 2000.0;

/// One reading of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// The device's own time, ns, where it sends it; its zero is arbitrary, and it may begin anew.
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
    /// Whether every value is one that can be measured: a device may send others when it is not
    /// ready, and libphidget22 gives 1e300 for "unknown".
    pub fn known(&self) -> bool {
        // NaN compares false.
        let below = |values: &[f64], most: f64| values.iter().all(|value| value.abs() <= most);
        below(&self.rate_rad_s, RATE_MAX_RAD_S)
            && below(&self.acceleration_m_s2, ACCELERATION_MAX_M_S2)
    }
}

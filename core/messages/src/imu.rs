//! `imu/sample`: one reading of an inertial measurement unit.

use crate::{Header, plain};

plain! {
    /// One reading in the IMU's own frame (x forward, y left, z up when mounted upright, SI
    /// units).
    pub struct ImuSample {
        /// `stamp_ns` is the estimated instant of measurement.
        pub header: Header,
        /// The device's own time, ns; its zero is arbitrary.
        pub device_ns: i64,
        /// When the sample reached the host, ns.
        pub arrival_ns: i64,
        /// Angular rate about x, y, z, rad/s.
        pub rate_rad_s: [f64; 3],
        /// Specific force along x, y, z, m/s^2; about +9.81 on z at rest and upright.
        pub acceleration_m_s2: [f64; 3],
    }
}

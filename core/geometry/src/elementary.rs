//! Elementary functions with the same bits on every machine.
//!
//! std's go to the platform's libm, whose results change with its version and with FMA.

/// Half a turn.
pub const PI: f64 = core::f64::consts::PI;

pub use libm::{acos, asin, atan2, cos, exp, log as ln, pow, sin, sincos as sin_cos};

/// The same angle in [-pi, pi).
pub fn wrap(angle_rad: f64) -> f64 {
    let turns = ((angle_rad + PI) / (2.0 * PI)).floor();
    let wrapped = angle_rad - turns * (2.0 * PI);
    // Rounding can give a value just outside on either side.
    if wrapped >= PI {
        wrapped - 2.0 * PI
    } else if wrapped < -PI {
        -PI
    } else {
        wrapped
    }
}

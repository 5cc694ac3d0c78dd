//! Elementary functions with the same bits on every machine.
//!
//! std's go to the platform's libm, whose results change with its version and with FMA.

/// Half a turn.
pub const PI: f64 = core::f64::consts::PI;

/// Sine and cosine of an angle in radians.
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    libm::sincos(angle_rad)
}

/// Sine of an angle in radians.
pub fn sin(angle_rad: f64) -> f64 {
    libm::sin(angle_rad)
}

/// Cosine of an angle in radians.
pub fn cos(angle_rad: f64) -> f64 {
    libm::cos(angle_rad)
}

/// Angle of the vector (x, y) in (-pi, pi].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Arc cosine.
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// Arc sine.
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// Natural exponential.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm.
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// x to the power y.
pub fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

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

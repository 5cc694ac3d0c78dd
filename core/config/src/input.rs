//! Whether a sensor's description fits what an input holds.

use crate::{Error, Sensor};

/// Models of one family differ by less than this factor, families by more.
const FACTOR_MAX: f64 = 1.5;

/// What an input holds of the radar that made it; `None` where it holds nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputGeometry {
    /// Width of a range bin, m.
    pub range_resolution_m: Option<f64>,
    /// Angle between beams, rad.
    pub azimuth_step_rad: Option<f64>,
    /// Farthest bin or return, m.
    pub range_max_m: Option<f64>,
}

/// Refuses a sensor that is not the input's.
///
/// A farthest return well inside the sensor's reach is no misfit: the room may be small.
pub fn check_input(sensor: &Sensor, input: &InputGeometry) -> Result<(), Error> {
    let fits = |key, configured: f64, found: Option<f64>, least: f64| {
        let fits = least..=configured * FACTOR_MAX;
        // Zero means unknown in a sweep's head.
        let known = found.filter(|found| found.is_finite() && *found > 0.0);
        let misfit = known.filter(|found| !fits.contains(found));
        misfit.map_or(Ok(()), |found| {
            Err(Error::SensorMismatch {
                sensor: sensor.name.clone(),
                key,
                configured,
                found,
            })
        })
    };
    let (bin_m, step_rad) = (sensor.range_resolution_m, sensor.azimuth_step_rad);
    fits(
        "range_resolution_m",
        bin_m,
        input.range_resolution_m,
        bin_m / FACTOR_MAX,
    )?;
    fits(
        "azimuth_step_rad",
        step_rad,
        input.azimuth_step_rad,
        step_rad / FACTOR_MAX,
    )?;
    fits("range_max_m", sensor.range_max_m, input.range_max_m, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_radars_input_is_refused_and_ones_own_is_not() {
        let isdr_c = Sensor::default();
        let room = InputGeometry {
            range_resolution_m: Some(0.0161),
            azimuth_step_rad: Some(0.0287),
            range_max_m: Some(9.0),
        };
        let oxford = InputGeometry {
            range_resolution_m: Some(0.0432),
            azimuth_step_rad: Some(0.0157),
            range_max_m: Some(162.8),
        };
        assert!(check_input(&isdr_c, &room).is_ok());
        assert!(check_input(&isdr_c, &InputGeometry::default()).is_ok());
        let text = check_input(&isdr_c, &oxford).unwrap_err().to_string();
        assert!(
            text.contains("sensor.range_resolution_m is 0.0161, the input has 0.0432"),
            "{text}"
        );
        let far = InputGeometry {
            range_max_m: oxford.range_max_m,
            ..InputGeometry::default()
        };
        assert!(check_input(&isdr_c, &far).is_err());
    }
}

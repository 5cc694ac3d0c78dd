//! Whether a sweep can be of the configured radar.

use randt_config::{Config, Error, InputGeometry, check_input};
use randt_messages::SweepHead;

/// Refuses a sweep whose bins or beams are not the configured radar's.
pub fn check_sweep(sweep: &SweepHead, config: &Config) -> Result<(), Error> {
    // Micrometres and microradians: the message's single precision has no more.
    let rounded = |value: f32| Some((f64::from(value) * 1e6).round() * 1e-6);
    let geometry = InputGeometry {
        range_resolution_m: rounded(sweep.range_resolution_m),
        azimuth_step_rad: rounded(sweep.azimuth_step_rad),
        range_max_m: None,
    };
    check_input(&config.sensor, &geometry)
}

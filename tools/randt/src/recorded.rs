//! The configuration of the run that a log was recorded from.

use crate::job::mounted;
use randt_config::{Config, Error, Selection};
use randt_log::Robot;
use randt_readers::Extrinsics;

/// The configuration of a recorded run; where the log has none, the built-in one for the log's
/// radar. The mounting of the sensors is the log's.
pub fn configuration(robot: Robot, recorded: Option<&str>) -> Result<Config, Error> {
    let loaded = Config::load(&Selection {
        recorded: recorded.map(str::to_owned),
        sensor_from_input: robot.sensor.name(),
        ..Selection::default()
    })?;
    Ok(mounted(loaded, &Extrinsics::from(robot)).config)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_recorded_holds_and_the_mounting_is_the_logs() {
        let robot = Robot {
            radar: Some([0.25, 0.0, 0.5]),
            ..Robot::default()
        };
        let config = configuration(robot, Some("[ndt]\ncell_size_m = 0.75\n")).unwrap();
        assert_eq!(config.ndt.cell_size_m, 0.75);
        assert_eq!(
            (config.robot.radar_x_m, config.robot.radar_yaw_rad),
            (0.25, 0.5)
        );
        assert!(configuration(robot, None).is_ok());
        // Another build may have had another key; a value that does not run is refused.
        assert!(configuration(robot, Some("[ndt]\nno_key = 1\n")).is_ok());
        let text = configuration(robot, Some("[ndt]\ncell_size_m = 0\n")).unwrap_err();
        assert!(text.to_string().contains("ndt.cell_size_m is 0"), "{text}");
    }
}

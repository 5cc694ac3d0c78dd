//! Whether gravity points where it should.

use nalgebra::Vector3;
use randt_config::Robot;
use randt_filter::{Mounting, MountingCheck};
use randt_geometry::Quaternion;

/// Watches gravity until it is known which way is up.
#[derive(Clone, Debug)]
pub(crate) struct Upright {
    /// IMU to base_link.
    mounting: Quaternion,
    check: MountingCheck,
    /// Whether gravity was seen.
    pub known: bool,
    /// What is wrong, or an empty text.
    pub complaint: String,
}

impl Upright {
    pub(crate) fn new(robot: &Robot) -> Self {
        Self {
            mounting: Quaternion::from_roll_pitch_yaw(
                robot.imu_roll_rad,
                robot.imu_pitch_rad,
                robot.imu_yaw_rad,
            ),
            check: MountingCheck::default(),
            known: false,
            complaint: String::new(),
        }
    }

    /// Begins anew: the device was opened again, and may be another one.
    pub(crate) fn restart(&mut self) {
        (self.check, self.known) = (MountingCheck::default(), false);
    }

    /// Takes a sample, in the IMU's axes.
    pub(crate) fn push(&mut self, stamp_ns: i64, acceleration_m_s2: [f64; 3]) {
        if self.known {
            return;
        }
        let force = self.mounting.rotate(Vector3::from(acceleration_m_s2));
        let Some(result) = self.check.push(stamp_ns, force) else {
            return;
        };
        self.known = true;
        let how = match result.mounting {
            Mounting::Upright => return self.complaint.clear(),
            Mounting::UpsideDown => "upside down",
            Mounting::OnItsSide => "on its side",
        };
        self.complaint = format!(
            "{how}: up is {} of the robot; set imu.acceleration_axes (the sign of gravity), or robot.imu_roll_rad and \
             imu_pitch_rad (how it is mounted)",
            result.up_axis()
        );
    }
}

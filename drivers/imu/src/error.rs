//! Why an IMU cannot be driven at all. What is wrong with a device is no error: it is the text of
//! its link, and it is tried again without end.

use randt_config::Origins;

/// Why an IMU cannot be driven at all.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value that its type allows but its meaning does not.
    #[error("imu.{key} is {found:?}, it must be {expected}")]
    Value {
        /// The key in section `imu`.
        key: &'static str,
        /// Its value.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
}

impl Error {
    /// As an error of the configuration, which has the origin of the value and ends a process as
    /// bad configuration.
    pub fn in_configuration(self, origins: &Origins) -> randt_config::Error {
        let Self::Value {
            key,
            found,
            expected,
        } = self;
        randt_config::Error::value(origins, ("imu", key), &found, expected.to_owned())
    }
}

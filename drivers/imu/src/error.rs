//! Why an IMU cannot be driven at all. What is wrong with a device is no error: it is the text of
//! its link, and it is tried again without end.

use randt_config::Origins;

/// A value of the configuration that its type allows but its meaning does not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("imu.{key} is {found:?}, it must be {expected}")]
pub struct Error {
    /// The key in section `imu`.
    key: &'static str,
    /// Its value.
    found: String,
    /// What would be right.
    expected: &'static str,
}

impl Error {
    pub(crate) fn new(key: &'static str, found: &str, expected: &'static str) -> Self {
        let found = found.to_owned();
        Self {
            key,
            found,
            expected,
        }
    }

    /// As an error of the configuration, which has the origin of the value and ends a process as
    /// bad configuration.
    pub fn in_configuration(self, origins: &Origins) -> randt_config::Error {
        let key = ("imu", self.key);
        randt_config::Error::value(origins, key, &self.found, self.expected.to_owned())
    }
}

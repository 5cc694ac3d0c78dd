//! What is wrong with a gyro, in words and with what to set.

use crate::gyro_rates::Repeated;
use randt_persist::persist_enum;
use std::fmt;

/// Ratio from which degrees were taken for radians: 57.3, and less where turns are short.
const DEGREES_MIN: f64 = 30.0;

/// A scale that is off by less is nearly right, thousandths.
const NEARLY_RIGHT_PERMILLE: i64 = 100;

/// What the radar shows of a gyro. Values are in thousandths, so that faults can be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GyroFault {
    /// Nothing.
    #[default]
    None,
    /// They turn differently, it is not known how.
    Disagrees,
    /// Gravity points down.
    UpsideDown,
    /// They turn opposite ways.
    Opposite,
    /// The gyro turns that many thousandths of what the radar does.
    Scaled(i64),
    /// Its bias is another one, in thousandths of a degree/s.
    Biased(i64),
    /// It repeats one rate, in thousandths of a rad/s.
    Frozen(i64),
    /// Its rates end at a value, likewise.
    Clipped(i64),
    /// Its stamps are late, ms.
    Delayed(i64),
}

persist_enum!(GyroFault {
    None,
    Disagrees,
    UpsideDown,
    Opposite,
    Scaled(permille),
    Biased(millideg_s),
    Frozen(mrad_s),
    Clipped(mrad_s),
    Delayed(ms),
});

fn thousandths(value: f64) -> i64 {
    (value * 1000.0) as i64
}

impl GyroFault {
    /// Whether it comes again where the gyro agrees for a while.
    pub(super) fn lasts(self) -> bool {
        matches!(
            self,
            Self::UpsideDown | Self::Opposite | Self::Scaled(_) | Self::Clipped(_)
        )
    }

    /// Whether it is read from turns, which may be too few. A scale that is nearly right is not:
    /// only the whole drive shows it.
    pub(super) fn is_of_turns(self) -> bool {
        match self {
            Self::Opposite => true,
            Self::Scaled(permille) => (permille - 1000).abs() > NEARLY_RIGHT_PERMILLE,
            _ => false,
        }
    }

    pub(super) fn scaled(ratio: f64) -> Self {
        Self::Scaled(thousandths(ratio))
    }

    pub(super) fn biased(bias_rad_s: f64) -> Self {
        Self::Biased(thousandths(bias_rad_s.to_degrees()))
    }

    pub(super) fn delayed(delay_s: f64) -> Self {
        Self::Delayed(thousandths(delay_s))
    }

    pub(super) fn repeats(repeated: &Repeated) -> Self {
        let mrad_s = thousandths(repeated.rate_rad_s);
        if repeated.is_largest {
            Self::Clipped(mrad_s)
        } else {
            Self::Frozen(mrad_s)
        }
    }
}

impl fmt::Display for GyroFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whole = |thousandths: &i64| *thousandths as f64 * 1e-3;
        match self {
            Self::None => write!(f, "gyro and radar agree"),
            Self::Disagrees => write!(f, "gyro and radar turn differently"),
            Self::UpsideDown => write!(
                f,
                "gravity points down, gyro and radar turn opposite ways: the IMU is upside down: robot.imu_roll_rad"
            ),
            Self::Opposite => write!(
                f,
                "gyro and radar turn opposite ways: the gyro's sign or axis, or a radar read in a mirror: imu.rate_axes, robot.imu_roll_rad, or the sense in which the bridge counts azimuths"
            ),
            Self::Scaled(permille) if whole(permille).abs() > DEGREES_MIN => write!(
                f,
                "the gyro turns {:.0} times as far as the radar: rates in degrees instead of radians",
                whole(permille)
            ),
            Self::Scaled(permille) => write!(
                f,
                "the gyro turns {:.2} times as far as the radar: its unit, scale or axis",
                whole(permille)
            ),
            Self::Biased(millideg_s) => {
                write!(f, "the gyro's bias is {:.1} degrees/s", whole(millideg_s))
            }
            Self::Frozen(mrad_s) => {
                write!(f, "the gyro repeats {:.3} rad/s", whole(mrad_s))
            }
            Self::Clipped(mrad_s) => write!(
                f,
                "the gyro's rates end at {:.3} rad/s: its measuring range",
                whole(mrad_s)
            ),
            Self::Delayed(ms) => write!(
                f,
                "the radar's stamps are {:.2} s late against the gyro's: odometry.radar_late_s",
                -whole(ms)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;

    #[test]
    fn what_is_to_be_set_exists() {
        let faults = [
            GyroFault::UpsideDown,
            GyroFault::Opposite,
            GyroFault::Delayed(-100),
        ];
        let mut named = 0;
        for fault in faults {
            let text = fault.to_string();
            let words = text.split(|c: char| !(c.is_alphanumeric() || "._".contains(c)));
            let keys = words.filter_map(|word| word.split_once('.'));
            for (section, key) in keys.filter(|(section, _)| section.parse::<u32>().is_err()) {
                let found = Config::default().get(section, key);
                assert!(found.is_some(), "{text}: {section}.{key}");
                named += 1;
            }
        }
        assert_eq!(named, 4);
    }
}

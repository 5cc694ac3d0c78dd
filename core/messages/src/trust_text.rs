//! Trust as a text for people.

use crate::{Localizability, OdometryState, TrustReason};
use std::f64::consts::FRAC_PI_8;
use std::fmt;

/// A line such as "degraded: nothing seen along +12 deg (ahead), scans fit the map poorly".
#[derive(Clone, Copy, Debug)]
pub struct TrustText<'a>(&'a OdometryState);

impl<'a> TrustText<'a> {
    /// Of a state.
    pub fn new(state: &'a OdometryState) -> Self {
        Self(state)
    }

    fn reason(&self, reason: TrustReason, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = self.0;
        out.write_str(match reason {
            TrustReason::Unsupported => "too few cells with counterparts in the map",
            TrustReason::Weak if state.localizability() == Localizability::None => {
                "nothing seen in any direction"
            }
            TrustReason::Weak => {
                let direction = Direction(state.weak_direction_rad);
                return write!(out, "nothing seen along {direction}");
            }
            TrustReason::Fit => "scans fit the map poorly",
            TrustReason::Contested => "beams of two senders",
            TrustReason::Repeated => "the radar repeats its scan",
            TrustReason::Held => "doubted in the last second or metres",
            TrustReason::Rate => "faster than the robot can move",
            TrustReason::Imu => "radar and IMU do not agree on the speed",
            TrustReason::Moving => "what the radar sees moves along",
        })
    }
}

impl fmt::Display for TrustText<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.0.trust().as_str())?;
        for (reason, before) in TrustReason::in_set(self.0.trust_reasons)
            .zip(std::iter::once(": ").chain(std::iter::repeat(", ")))
        {
            out.write_str(before)?;
            self.reason(reason, out)?;
        }
        Ok(())
    }
}

/// A direction and its opposite, in the robot's frame.
struct Direction(f64);

impl fmt::Display for Direction {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self.0 {
            left if left.abs() > 3.0 * FRAC_PI_8 => "sideways",
            left if left > FRAC_PI_8 => "ahead left",
            left if left < -FRAC_PI_8 => "ahead right",
            _ => "ahead",
        };
        write!(out, "{:+.0} deg ({words})", self.0.to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trust;

    #[test]
    fn every_reason_is_named_and_a_direction_has_words() {
        let mut state = OdometryState {
            trust: Trust::Good as u32,
            ..OdometryState::default()
        };
        assert_eq!(TrustText::new(&state).to_string(), "good");
        state.trust = Trust::Degraded as u32;
        state.trust_reasons = TrustReason::Weak as u32 | TrustReason::Contested as u32;
        state.localizability = Localizability::Partial as u32;
        for (degrees, along) in [
            (12.4, "+12 deg (ahead)"),
            (-30.0, "-30 deg (ahead right)"),
            (45.0, "+45 deg (ahead left)"),
            (-90.0, "-90 deg (sideways)"),
        ] {
            state.weak_direction_rad = f64::to_radians(degrees);
            let expected = format!("degraded: nothing seen along {along}, beams of two senders");
            assert_eq!(TrustText::new(&state).to_string(), expected);
        }
        state.localizability = Localizability::None as u32;
        state.trust_reasons = TrustReason::Weak as u32;
        let text = TrustText::new(&state).to_string();
        assert_eq!(text, "degraded: nothing seen in any direction");
    }
}

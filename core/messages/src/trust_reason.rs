//! Why a pose is not believed.

/// One reason against a pose. Messages have a set of them, a bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum TrustReason {
    /// Too few cells of the scan have counterparts in the submap to fix a pose.
    Unsupported = 1,
    /// The scan does not see some direction.
    Weak = 1 << 1,
    /// The last scans fit their submap poorly, or the newest one shows another world than the scan
    /// before it.
    Fit = 1 << 2,
    /// Beams of two senders came in the sweep.
    Contested = 1 << 3,
    /// The radar repeats its scan.
    Repeated = 1 << 4,
    /// One of the others was there a moment ago, or the position drifted over the last metres.
    Held = 1 << 5,
    /// The pose moves faster than the robot can.
    Rate = 1 << 6,
    /// Radar and IMU do not agree on how fast the robot moves.
    Imu = 1 << 7,
    /// Part of what the radar sees moves along with the robot.
    Moving = 1 << 8,
}

impl TrustReason {
    /// All, in the order of their bits.
    pub const ALL: [Self; 9] = [
        Self::Unsupported,
        Self::Weak,
        Self::Fit,
        Self::Contested,
        Self::Repeated,
        Self::Held,
        Self::Rate,
        Self::Imu,
        Self::Moving,
    ];

    /// Its name in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Unsupported => "unsupported",
            Self::Weak => "weak",
            Self::Fit => "fit",
            Self::Contested => "contested",
            Self::Repeated => "repeated",
            Self::Held => "held",
            Self::Rate => "rate",
            Self::Imu => "imu",
            Self::Moving => "moving",
        }
    }

    /// Its bit where it applies, else nothing.
    pub fn bit_if(self, applies: bool) -> u32 {
        if applies { self as u32 } else { 0 }
    }

    /// Those in a set.
    pub fn in_set(bits: u32) -> impl Iterator<Item = Self> {
        let all = Self::ALL.into_iter();
        all.filter(move |reason| bits & *reason as u32 != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_what_was_put_into_it() {
        let bits = TrustReason::Held.bit_if(true)
            | TrustReason::Weak.bit_if(true)
            | TrustReason::Fit.bit_if(false);
        let reasons: Vec<_> = TrustReason::in_set(bits).collect();
        assert_eq!(reasons, [TrustReason::Weak, TrustReason::Held]);
        // A bit of a later build is none of these.
        assert_eq!(TrustReason::in_set(1 << 31 | 511).count(), 9);
        assert_eq!(TrustReason::in_set(0).count(), 0);
    }
}

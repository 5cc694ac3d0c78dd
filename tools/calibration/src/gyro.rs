//! The gyro's turn about the robot's vertical as a function of time.

/// One sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YawRate {
    /// Its instant by the gyro's stamps, ns.
    pub stamp_ns: i64,
    /// Rate of the heading, with the bias, rad/s.
    pub rate_rad_s: f64,
}

/// A hole above this is not bridged, ns: in 20 ms a robot's turn changes by less than a radar
/// sees.
const HOLE_NS: i64 = 20_000_000;

/// The gyro at a sample.
#[derive(Clone, Copy, Debug)]
struct GyroState {
    stamp_ns: i64,
    angle_rad: f64,
    rate_rad_s: f64,
}

/// The integrated yaw rate, with the bias.
#[derive(Clone, Debug, Default)]
pub struct Gyro {
    states: Vec<GyroState>,
    /// Begins of holes and their ends, ns.
    holes: Vec<(i64, i64)>,
    /// Samples that held no numbers, repeated a stamp or went back in time.
    pub rejected: u64,
}

impl Gyro {
    /// Integrates.
    pub fn new(samples: &[YawRate]) -> Self {
        let mut gyro = Self::default();
        for sample in samples {
            let rate_rad_s = sample.rate_rad_s;
            let last = gyro.states.last().copied();
            if !rate_rad_s.is_finite() || last.is_some_and(|last| sample.stamp_ns <= last.stamp_ns)
            {
                gyro.rejected += 1;
                continue;
            }
            let angle_rad = last.map_or(0.0, |last| {
                let dt_ns = sample.stamp_ns - last.stamp_ns;
                if dt_ns > HOLE_NS {
                    gyro.holes.push((last.stamp_ns, sample.stamp_ns));
                }
                last.angle_rad + 0.5 * (last.rate_rad_s + rate_rad_s) * dt_ns as f64 * 1e-9
            });
            gyro.states.push(GyroState {
                stamp_ns: sample.stamp_ns,
                angle_rad,
                rate_rad_s,
            });
        }
        gyro
    }

    /// Angle and rate at an instant; `None` outside the samples.
    pub fn at(&self, stamp_ns: i64) -> Option<(f64, f64)> {
        let after = self.states.partition_point(|m| m.stamp_ns <= stamp_ns);
        let a = self.states.get(after.checked_sub(1)?)?;
        let b = self.states.get(after)?;
        let [s, dt] = [stamp_ns, b.stamp_ns].map(|ns| (ns - a.stamp_ns) as f64 * 1e-9);
        let slope = (b.rate_rad_s - a.rate_rad_s) / dt;
        let angle_rad = a.angle_rad + s * (a.rate_rad_s + 0.5 * slope * s);
        Some((angle_rad, a.rate_rad_s + slope * s))
    }

    /// Whether samples cover a span without a hole.
    pub fn covers(&self, begin_ns: i64, end_ns: i64) -> bool {
        let begins = self
            .states
            .first()
            .is_some_and(|it| it.stamp_ns <= begin_ns);
        let ends = self.states.last().is_some_and(|it| end_ns < it.stamp_ns);
        let next = self.holes.partition_point(|(_, end)| *end <= begin_ns);
        let hole = self.holes.get(next);
        begins && ends && hole.is_none_or(|(begin, _)| *begin >= end_ns)
    }
}

//! Whether the gyro's rates are measured ones.

use super::capture::Seen;
use crate::commands::doctor::finding::Finding;
use randt_messages::ImuSample;
use randt_odometry::GyroRates;

const ABOUT: &str = "gyro";
/// All six values stay the same to the last bit for that many samples: nothing measures them.
const FROZEN_SAMPLES: usize = 25;
/// A gyro's noise, as the median step from sample to sample, is below this, rad/s: cheap ones have
/// 0.005, ten times that in degrees 0.3 and more.
const STEP_MAX_RAD_S: f64 = 0.1;
/// One spike may be a knock on the robot.
const SPIKES_MAX: u64 = 1;

/// What the samples show by themselves, standing or turning; the worst finding.
pub fn check(seen: &Seen<ImuSample>) -> Option<Finding> {
    let samples = || seen.came.iter().map(|(_, sample)| sample);
    let is_same = |a: &ImuSample, b: &ImuSample| {
        (a.rate_rad_s, a.acceleration_m_s2) == (b.rate_rad_s, b.acceleration_m_s2)
    };
    let (mut same, mut longest) = (1, 1);
    for (before, now) in samples().zip(samples().skip(1)) {
        same = if is_same(before, now) { same + 1 } else { 1 };
        longest = longest.max(same);
    }
    if longest >= FROZEN_SAMPLES {
        let text = format!("{longest} samples in a row are the same to the last bit");
        let fix =
            "the IMU or its bridge repeats an old sample: restart it, and do not drive with it";
        return Some(Finding::bad(ABOUT, text, fix));
    }
    let mut spikes = 0;
    for axis in 0..3 {
        let name = ["x", "y", "z"].get(axis).copied().unwrap_or_default();
        let rate = |sample: &ImuSample| sample.rate_rad_s.get(axis).copied().unwrap_or_default();
        let steps = samples().zip(samples().skip(1));
        let steps = steps.map(|(before, now)| (rate(now) - rate(before)).abs());
        let step_rad_s = median(steps.collect());
        if step_rad_s > STEP_MAX_RAD_S {
            let text =
                format!("rates about {name} change by {step_rad_s:.2} rad/s from sample to sample");
            let fix = "no gyro is that noisy: rates in degrees instead of radians?";
            return Some(Finding::bad(ABOUT, text, fix));
        }
        let mut rates = GyroRates::default();
        for sample in samples() {
            rates.push(sample.header.stamp_ns, rate(sample));
        }
        spikes += rates.spikes;
        if let Some(repeated) = rates.repeated_since(i64::MIN) {
            let value = repeated.rate_rad_s;
            return Some(if repeated.is_largest {
                let text = format!("rates about {name} end at {value:.3} rad/s");
                let fix = "a gyro of a larger measuring range, or slower turns";
                Finding::bad(ABOUT, text, fix)
            } else {
                let text = format!("{value:.3} rad/s about {name} is repeated for over 0.1 s");
                let fix =
                    "the IMU repeats old rates: is its rate higher than it can (imu.rate_hz)?";
                Finding::bad(ABOUT, text, fix)
            });
        }
    }
    (spikes > SPIKES_MAX).then(|| {
        let text = format!("{spikes} rates are spikes; odometry leaves them out");
        let fix =
            "bytes that are damaged, or a loose plug: checksums, a shorter cable, a slower port";
        Finding::warn(ABOUT, text, fix)
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::sin;

    /// Five seconds of a robot that stands or turns to and fro, with noise, and changed.
    fn seen(turn_rad_s: f64, change: impl Fn(usize, &mut ImuSample)) -> Seen<ImuSample> {
        let mut seen = Seen::default();
        let mut random = 1_u32;
        let mut noise = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (f64::from(random >> 8) / f64::from(1_u32 << 24) - 0.5) * 0.02
        };
        for number in 0..1250 {
            let at_s = number as f64 * 0.004;
            let mut sample = ImuSample {
                rate_rad_s: [noise(), noise(), noise() + turn_rad_s * sin(2.0 * at_s)],
                acceleration_m_s2: [noise(), noise(), 9.8 + noise()],
                ..ImuSample::default()
            };
            sample.header.stamp_ns = 1_000_000_000 + number as i64 * 4_000_000;
            change(number, &mut sample);
            seen.came.push((sample.header.stamp_ns, sample));
        }
        seen
    }

    fn text(turn_rad_s: f64, change: impl Fn(usize, &mut ImuSample)) -> String {
        check(&seen(turn_rad_s, change)).map_or(String::new(), |finding| finding.to_string())
    }

    #[test]
    fn what_no_gyro_measures_is_bad() {
        for turn_rad_s in [0.0, 0.8] {
            assert_eq!(text(turn_rad_s, |_, _| ()), "");
            let degrees = text(turn_rad_s, |_, sample| {
                sample.rate_rad_s = sample.rate_rad_s.map(f64::to_degrees);
            });
            assert!(
                degrees.contains("BAD") && degrees.contains("degrees"),
                "{degrees}"
            );
            let frozen = text(turn_rad_s, |number, sample| {
                if number > 1200 {
                    sample.rate_rad_s = [0.1, 0.2, 0.3];
                    sample.acceleration_m_s2 = [0.0, 0.0, 9.8];
                }
            });
            assert!(
                frozen.contains("BAD") && frozen.contains("49 samples in a row"),
                "{frozen}"
            );
        }
        let clipped = text(0.8, |_, sample| {
            sample.rate_rad_s[2] = sample.rate_rad_s[2].clamp(-0.5, 0.5);
        });
        assert!(
            clipped.contains("about z end at 0.500") || clipped.contains("end at -0.500"),
            "{clipped}"
        );
        let repeated = text(0.8, |number, sample| {
            if (300..400).contains(&number) {
                sample.rate_rad_s[2] = 0.25;
            }
        });
        assert!(
            repeated.contains("0.250 rad/s about z is repeated"),
            "{repeated}"
        );
        let spikes = text(0.8, |number, sample| {
            sample.rate_rad_s[2] += if number % 250 == 9 { 5.0 } else { 0.0 };
        });
        assert!(
            spikes.contains("WARN") && spikes.contains("5 rates are spikes"),
            "{spikes}"
        );
    }
}

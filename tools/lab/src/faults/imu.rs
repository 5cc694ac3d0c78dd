//! An IMU that lies.

use super::Change;
use randt_readers::Event;
use randt_simulator::Random;

/// One rate in that many is a spike, and how large it is, rad/s.
const SPIKE_EVERY: u32 = 500;
const SPIKE_RAD_S: f64 = 5.0;
/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// Ten times the noise of the simulated IMU.
const NOISE_RAD_S: f64 = 0.03;
const NOISE_M_S2: f64 = 0.2;

/// A gyro that sends something else than the yaw rate, given that and the time, s.
pub(super) fn gyro(mut lie: impl FnMut(f64, f64) -> f64 + 'static) -> Change {
    Box::new(move |event, at_s| {
        if let Event::Imu(sample) = event {
            let [_, _, yaw] = &mut sample.rate_rad_s;
            *yaw = lie(*yaw, at_s);
        }
        true
    })
}

/// Turned about its x axis.
pub(super) fn upside_down() -> Change {
    Box::new(|event, _| {
        if let Event::Imu(sample) = event {
            for [_, y, z] in [&mut sample.rate_rad_s, &mut sample.acceleration_m_s2] {
                (*y, *z) = (-*y, -*z);
            }
        }
        true
    })
}

/// Without gravity, as some drivers send it.
pub(super) fn no_gravity() -> Change {
    Box::new(|event, _| {
        if let Event::Imu(sample) = event {
            let [_, _, up] = &mut sample.acceleration_m_s2;
            *up -= GRAVITY_M_S2;
        }
        true
    })
}

/// The yaw rate stays as it was.
pub(super) fn frozen(from_s: f64, for_s: f64) -> Change {
    let mut last = 0.0;
    gyro(move |rate, at_s| {
        if !(from_s..from_s + for_s).contains(&at_s) {
            last = rate;
        }
        last
    })
}

/// Single rates are off.
pub(super) fn spikes() -> Change {
    let mut samples = 0_u32;
    gyro(move |rate, _| {
        samples += 1;
        if samples.is_multiple_of(SPIKE_EVERY) {
            rate + SPIKE_RAD_S
        } else {
            rate
        }
    })
}

/// A bias, degrees/s by the time since its onset, s.
pub(super) fn bias(from_s: f64, bias_deg_s: impl Fn(f64) -> f64 + 'static) -> Change {
    gyro(move |rate, at_s| {
        if at_s < from_s {
            rate
        } else {
            rate + bias_deg_s(at_s - from_s).to_radians()
        }
    })
}

/// Its stamps are late from then on, ms.
pub(super) fn late(from_s: f64, late_ms: i64) -> Change {
    Box::new(move |event, at_s| {
        if let Event::Imu(sample) = event
            && at_s >= from_s
        {
            sample.header.stamp_ns += late_ms * 1_000_000;
        }
        true
    })
}

/// Noise is added.
pub(super) fn noise(mut random: Random) -> Change {
    Box::new(move |event, _| {
        if let Event::Imu(sample) = event {
            let [rates, accelerations] = [&mut sample.rate_rad_s, &mut sample.acceleration_m_s2];
            for (values, sigma) in [(rates, NOISE_RAD_S), (accelerations, NOISE_M_S2)] {
                values
                    .iter_mut()
                    .for_each(|value| *value += sigma * random.normal());
            }
        }
        true
    })
}

/// It sends nothing.
pub(super) fn silent(from_s: f64, for_s: f64) -> Change {
    Box::new(move |event, at_s| {
        !(matches!(event, Event::Imu(_)) && (from_s..from_s + for_s).contains(&at_s))
    })
}

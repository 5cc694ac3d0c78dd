//! Limits of plausible values and of what a message holds.

use crate::counters::Counters;
use randt_messages::MAX_RETURNS;

/// Latest plausible instant, ns: the year 2116. Differences of two plausible instants never
/// overflow.
const INSTANT_MAX_NS: i64 = i64::MAX / 2;

/// Whether a stamp can be that of a measurement.
pub(crate) fn is_instant(stamp_ns: i64) -> bool {
    (0..=INSTANT_MAX_NS).contains(&stamp_ns)
}

/// Fastest plausible turn, rad/s: gyros end at 70 (4,000 deg/s).
const RATE_MAX_RAD_S: f64 = 100.0;
/// Largest plausible specific force, m/s^2: more than any IMU's 100 g.
const ACCELERATION_MAX_M_S2: f64 = 2000.0;

/// The counter under which an implausible reading of an IMU is left out; `None` for a plausible
/// one.
fn misreading(rate_rad_s: &[f64; 3], acceleration_m_s2: &[f64; 3]) -> Option<&'static str> {
    let within = |values: &[f64; 3], limit: f64| values.iter().all(|v| v.abs() <= limit);
    if !(within(rate_rad_s, f64::MAX) && within(acceleration_m_s2, f64::MAX)) {
        return Some("imu_samples_not_finite");
    }
    let is_plausible =
        within(rate_rad_s, RATE_MAX_RAD_S) && within(acceleration_m_s2, ACCELERATION_MAX_M_S2);
    (!is_plausible).then_some("imu_samples_out_of_range")
}

/// Leaves an implausible reading of an IMU out, and counts it; false for a plausible one.
pub(crate) fn is_misread(
    counters: &mut Counters,
    stamp_ns: i64,
    rate_rad_s: &[f64; 3],
    acceleration_m_s2: &[f64; 3],
) -> bool {
    let Some(name) = misreading(rate_rad_s, acceleration_m_s2) else {
        return false;
    };
    counters.count_loss(name, 1, || {
        format!(
            "{rate_rad_s:?} rad/s, {acceleration_m_s2:?} m/s^2 in the sample stamped {stamp_ns}"
        )
    });
    true
}

/// What is wrong with a stamp that [`is_instant`] refuses.
pub(crate) fn no_instant(stamp_ns: i64) -> String {
    format!("stamp {stamp_ns}, which no measurement has; expected ns since 1970")
}

/// The strongest of the items, as many as a message holds, in their order; of equal ones the
/// first.
pub(crate) fn strongest<T: Copy>(items: &[T], strength: impl Fn(&T) -> f32) -> Vec<T> {
    if items.len() <= MAX_RETURNS {
        return items.to_vec();
    }
    let mut ranked: Vec<(f32, usize)> = items.iter().map(strength).zip(0..).collect();
    ranked.select_nth_unstable_by(MAX_RETURNS, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    ranked.truncate(MAX_RETURNS);
    ranked.sort_unstable_by_key(|(_, index)| *index);
    let kept = ranked.iter().filter_map(|(_, index)| items.get(*index));
    kept.copied().collect()
}

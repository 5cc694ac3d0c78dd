//! Limits of plausible values and of what a message holds.

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
pub(crate) fn misreading(
    rate_rad_s: &[f64; 3],
    acceleration_m_s2: &[f64; 3],
) -> Option<&'static str> {
    let mut values = rate_rad_s.iter().chain(acceleration_m_s2);
    if !values.all(|value| value.is_finite()) {
        return Some("imu_samples_not_finite");
    }
    let measured = rate_rad_s.iter().all(|v| v.abs() <= RATE_MAX_RAD_S)
        && acceleration_m_s2
            .iter()
            .all(|v| v.abs() <= ACCELERATION_MAX_M_S2);
    (!measured).then_some("imu_samples_out_of_range")
}

/// The strongest of the items, as many as a message holds, in their order; of equal ones the
/// first.
pub(crate) fn strongest<T: Copy>(items: &[T], strength: impl Fn(&T) -> f32) -> Vec<T> {
    if items.len() <= MAX_RETURNS {
        return items.to_vec();
    }
    let mut ranked: Vec<(f32, usize)> = items.iter().map(&strength).zip(0..).collect();
    ranked.select_nth_unstable_by(MAX_RETURNS, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    ranked.truncate(MAX_RETURNS);
    ranked.sort_unstable_by_key(|(_, index)| *index);
    ranked
        .iter()
        .filter_map(|(_, index)| items.get(*index).copied())
        .collect()
}

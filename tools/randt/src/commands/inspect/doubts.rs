//! What is missing or odd, each in a line that says what to do.

use super::survey::Survey;
use crate::units::count;
use randt_readers::InputInfo;

/// Slowest IMU whose gyro de-skews a sweep, Hz.
const IMU_HZ_MIN: f64 = 50.0;
/// Mean specific forces between these, m/s^2, are those of an IMU that feels gravity.
const GRAVITY_M_S2: [f64; 2] = [8.8, 10.8];
/// No radar for robots has wider range bins, m.
const BIN_MAX_M: f64 = 2.0;
/// Turns above this, rad/s, are in degrees: a robot's are below 6.
const RATE_MAX_RAD_S: f64 = 12.0;

/// Everything that may make the result worse than it looks.
pub fn doubts(info: &InputInfo, survey: &Survey, needs_size: bool) -> Vec<String> {
    let mut doubts = Vec::new();
    let mut doubt = |condition: bool, text: String| {
        if condition {
            doubts.push(text);
        }
    };
    let bins = info.bin_size.map_or(0, |bins| bins.bins);
    doubt(
        needs_size,
        format!(
            "{bins} bins are not a CTS350-X's 3768: say sensor.range_resolution_m; ranges here are drawn for 0.05 m"
        ),
    );
    doubt(
        survey.sweeps == 0,
        "no sweep: nothing can be computed".to_owned(),
    );
    if survey.sweeps == 0 {
        return doubts;
    }
    let sweeps = count(survey.sweeps, "sweep", "sweeps");
    doubt(
        survey.empty_sweeps > 0,
        format!("{} of {sweeps} without a return", survey.empty_sweeps),
    );
    doubt(
        survey.sweep_gaps > 0,
        format!(
            "{} between sweeps, the longest of {:.1} s (odometry.gap_max_s bounds what is bridged)",
            count(survey.sweep_gaps, "gap", "gaps"),
            survey.longest_gap_s
        ),
    );
    doubt(
        survey.steps_back > 0,
        format!(
            "{} not after the one before: each begins a new frame",
            survey.steps_back
        ),
    );
    doubt(
        info.without_intensity.is_some(),
        "returns have no intensity: NDT in two dimensions (--intensity-field NAME takes a field)"
            .to_owned(),
    );
    doubt(
        survey.range_resolution_m.is_some_and(|m| m > BIN_MAX_M),
        format!(
            "bins of {:.1} m: positions may be in another unit than m",
            survey.range_resolution_m.unwrap_or_default()
        ),
    );
    doubt(
        info.extrinsics.radar.is_none() && info.configuration.is_none(),
        "the radar's mounting is not in the input: --robot FILE sets it".to_owned(),
    );
    if survey.imu_samples == 0 {
        return doubts;
    }
    doubt(
        survey.sweeps_with_imu == 0,
        "the IMU covers no sweep: its stamps are of another clock, or it ran at another time"
            .to_owned(),
    );
    doubt(
        survey.sweeps_with_imu > 0 && survey.sweeps_with_imu + 2 < survey.sweeps,
        format!("the IMU covers {} of {sweeps}", survey.sweeps_with_imu),
    );
    doubt(
        survey.imu_hz.is_some_and(|hz| hz < IMU_HZ_MIN),
        format!(
            "the IMU has {:.0} Hz: too slow to take a turn out of a sweep",
            survey.imu_hz.unwrap_or_default()
        ),
    );
    doubt(
        survey.imu_gaps > 0,
        format!(
            "{} in the IMU over 50 ms, the longest of {:.2} s",
            count(survey.imu_gaps, "gap", "gaps"),
            survey.longest_imu_gap_s
        ),
    );
    let [x, y, z] = survey.mean_force_m_s2;
    let force_m_s2 = (x * x + y * y + z * z).sqrt();
    let [least, most] = GRAVITY_M_S2;
    doubt(
        force_m_s2 < 1.0,
        format!("acceleration shows no gravity ({force_m_s2:.1} m/s2): tilt is not used"),
    );
    doubt(
        force_m_s2 >= 1.0 && !(least..=most).contains(&force_m_s2),
        format!(
            "acceleration shows {force_m_s2:.1} m/s2 where gravity is 9.8: its unit may be another"
        ),
    );
    let mounted = info
        .extrinsics
        .imu
        .map_or([x, y, z], |imu| imu.rotate([x, y, z].into()).into());
    let [_, _, up] = mounted;
    doubt(
        (least..=most).contains(&force_m_s2) && up < 0.7 * force_m_s2,
        format!(
            "gravity is {up:.1} m/s2 along z of base_link: the IMU hangs in another way than its mounting says (robot.imu_roll_rad)"
        ),
    );
    doubt(
        survey.largest_rate_rad_s == 0.0,
        "the gyro shows no rate at all, not even noise: it measures nothing (--no-imu)".to_owned(),
    );
    doubt(
        survey.largest_rate_rad_s > RATE_MAX_RAD_S,
        format!(
            "the gyro turns up to {:.0} rad/s: it may count degrees",
            survey.largest_rate_rad_s
        ),
    );
    doubts
}

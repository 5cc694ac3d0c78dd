//! What went wrong, counted.

use super::Odometry;
use crate::gyro_check::GyroFault;
use randt_persist::persist;

/// What was dropped, repaired or lacked support. As many fields as there are counters in the
/// report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Scans with stamps that no clock gives, or of a sweep that lasts over a minute: left out.
    pub scans_rejected: u64,
    /// Scans whose stamp repeats the one before: left out.
    pub scans_repeated: u64,
    /// Scans that repeat all returns of the one before: the radar stands still inside. Their
    /// returns are left out.
    pub scans_frozen: u64,
    /// Scans that found no support in the map, or had too few cells.
    pub scans_unsupported: u64,
    /// Scans for which the IMU ended before the sweep did, even by one sample.
    pub scans_imu_late: u64,
    /// The first of these: end of its sweep, ns, and how long before that the IMU ended, ns.
    pub imu_late_first_ns: i64,
    /// See there.
    pub imu_late_short_ns: i64,
    /// Of these, scans with a sample that had been published in time and was delivered after they
    /// had been computed: a computation of the log uses it.
    pub scans_imu_overtaken: u64,
    /// Scans without IMU although there had been one.
    pub scans_without_imu: u64,
    /// Scans without the gyro, because it did not turn as the radar did ...
    pub scans_gyro_refused: u64,
    /// ... and how, as last found.
    pub gyro_fault: GyroFault,
    /// Scans for which the gyro was read later than its stamps say, because these are wrong ...
    pub scans_gyro_shifted: u64,
    /// ... by this much, ms.
    pub gyro_late_ms: i64,
    /// How often the gyro's bias was no longer what it had been, and was estimated anew.
    pub gyro_bias_changes: u64,
    /// How often the gyro repeated its largest rate: its measuring range ends there ...
    pub gyro_clips: u64,
    /// ... mrad/s.
    pub gyro_largest_mrad_s: i64,
    /// Spikes of the gyro's rate, left out.
    pub gyro_spikes: u64,
    /// Scans by which the radar does not sit where it is configured ...
    pub scans_mounting_off: u64,
    /// ... and what is to be added to its place ahead, mm, and its yaw, mrad.
    pub mounting_forward_mm: i64,
    /// See there.
    pub mounting_yaw_mrad: i64,
    /// Odometry frames opened after the first.
    pub frames_reopened: u64,
    /// Solves without a result.
    pub solver_failures: u64,
    /// IMU samples left out: back in time, repeated, not finite.
    pub imu_rejected: u64,
    /// Holes in the IMU's samples above 0.1 s.
    pub imu_holes: u64,
    /// Samples of the IMU whose acceleration showed no gravity: their tilt is not used ...
    pub imu_without_gravity: u64,
    /// ... and what the last one showed, mm/s^2.
    pub imu_gravity_mm_s2: i64,
    /// Points outside of the submap's grid.
    pub points_outside: u64,
    /// Twists left out: back in time, repeated, not finite, without room.
    pub twists_rejected: u64,
    /// Scans whose way is by wheels, because their cells do not fix it.
    pub scans_by_twist: u64,
    /// Scans whose twists were left out because wheels do not say the truth.
    pub scans_twist_refused: u64,
    /// The first of these: end of its sweep, ns, and what wheels and radar or IMU said, mm/s.
    pub twist_refused_first_ns: i64,
    /// See there.
    pub twist_refused_mm_s: i64,
    /// See there.
    pub twist_true_mm_s: i64,
}

persist!(Counters {
    scans_rejected,
    scans_repeated,
    scans_frozen,
    scans_unsupported,
    scans_imu_late,
    imu_late_first_ns,
    imu_late_short_ns,
    scans_imu_overtaken,
    scans_without_imu,
    scans_gyro_refused,
    gyro_fault,
    scans_gyro_shifted,
    gyro_late_ms,
    gyro_bias_changes,
    gyro_clips,
    gyro_largest_mrad_s,
    gyro_spikes,
    scans_mounting_off,
    mounting_forward_mm,
    mounting_yaw_mrad,
    frames_reopened,
    solver_failures,
    imu_rejected,
    imu_holes,
    imu_without_gravity,
    imu_gravity_mm_s2,
    points_outside,
    twists_rejected,
    scans_by_twist,
    scans_twist_refused,
    twist_refused_first_ns,
    twist_refused_mm_s,
    twist_true_mm_s,
} sound has_room);

impl Counters {
    /// What wheels said when they were wrong for the first time, and what is the matter with them.
    pub fn twist_refused_text(&self) -> String {
        let [wheels_m_s, truth_m_s] =
            [self.twist_refused_mm_s, self.twist_true_mm_s].map(|mm_s| mm_s as f64 * 1e-3);
        // A robot or wheels of less than this stand.
        let standing_m_s = 0.1;
        let matter = if wheels_m_s.abs() < standing_m_s {
            "they are stuck, or no longer sent"
        } else if wheels_m_s * truth_m_s < 0.0 && truth_m_s.abs() > standing_m_s {
            "they count backwards"
        } else if wheels_m_s.abs() > truth_m_s.abs() {
            "they spin, or their scale is wrong"
        } else {
            "they slide, or their scale is wrong"
        };
        format!(
            "wheels say {wheels_m_s:.2} m/s where radar or IMU say {truth_m_s:.2} m/s, in the sweep that ends at {} ns: {matter}",
            self.twist_refused_first_ns
        )
    }

    /// Whether they can go on counting.
    fn has_room(&self) -> bool {
        [
            self.scans_rejected,
            self.scans_repeated,
            self.scans_frozen,
            self.scans_unsupported,
            self.scans_imu_late,
            self.scans_imu_overtaken,
            self.scans_without_imu,
            self.scans_gyro_refused,
            self.scans_gyro_shifted,
            self.frames_reopened,
            self.solver_failures,
            self.imu_rejected,
            self.imu_without_gravity,
            self.gyro_bias_changes,
            self.gyro_clips,
            self.gyro_spikes,
            self.scans_mounting_off,
            self.twists_rejected,
            self.scans_by_twist,
            self.scans_twist_refused,
        ]
        .iter()
        .all(|count| *count <= u64::MAX / 2)
    }
}

impl Counters {
    /// Whether something is wrong with the IMU.
    pub fn has_imu_fault(&self) -> bool {
        let faults = [
            self.scans_gyro_refused,
            self.scans_gyro_shifted,
            self.imu_without_gravity,
            self.gyro_bias_changes,
            self.gyro_clips,
        ];
        faults.iter().any(|count| *count > 0)
    }

    /// What that is, in words and with what to set.
    pub fn imu_text(&self) -> String {
        if self.scans_gyro_refused > 0 {
            let scans = self.scans_gyro_refused;
            format!("{}; {scans} scans without it", self.gyro_fault)
        } else if self.imu_without_gravity > 0 {
            self.gravity_text()
        } else if self.scans_gyro_shifted > 0 {
            self.shifted_text()
        } else if self.gyro_clips > 0 {
            self.clipped_text()
        } else {
            self.bias_text()
        }
    }

    /// That the gyro's stamps are set right.
    pub fn shifted_text(&self) -> String {
        format!("{}; set right", GyroFault::Delayed(self.gyro_late_ms))
    }

    /// That the gyro's rates end at a value.
    pub fn clipped_text(&self) -> String {
        GyroFault::Clipped(self.gyro_largest_mrad_s).to_string()
    }

    /// That the gyro's bias moved.
    pub fn bias_text(&self) -> String {
        "the gyro's bias moved more than a gyro's does: it is estimated anew by the radar".into()
    }

    /// Where the radar sits by turns and straights.
    pub fn mounting_text(&self) -> String {
        let forward_m = self.mounting_forward_mm as f64 * 1e-3;
        let yaw_rad = self.mounting_yaw_mrad as f64 * 1e-3;
        let mut shown = Vec::new();
        if forward_m != 0.0 {
            shown.push(format!(
                "turns show the radar {forward_m:+.2} m ahead of robot.radar_x_m"
            ));
        }
        if yaw_rad != 0.0 {
            shown.push(format!(
                "straights show it turned by {yaw_rad:+.3} rad from robot.radar_yaw_rad"
            ));
        }
        let shown = shown.join(", ");
        format!(
            "{shown}, or base_link is not the point that it turns about: randt calibrate extrinsics"
        )
    }

    /// That the acceleration shows no gravity.
    pub fn gravity_text(&self) -> String {
        let shown_m_s2 = self.imu_gravity_mm_s2 as f64 * 1e-3;
        format!("acceleration shows no gravity ({shown_m_s2:.1} m/s2): tilt not used")
    }
}

impl Odometry {
    /// What was dropped, repaired or lacked support so far.
    pub fn counters(&self) -> Counters {
        let mut counters = self.counters;
        counters.points_outside = self.submaps.outside;
        if let Some(gyro) = &self.gyro {
            counters.imu_rejected += gyro.rejected;
            counters.imu_holes = gyro.holes;
            counters.imu_without_gravity = gyro.gravity().missing;
            counters.imu_gravity_mm_s2 = (gyro.gravity().shown_m_s2 * 1e3) as i64;
            counters.gyro_bias_changes = self.gyro_check.bias_changes;
            counters.gyro_clips = gyro.rates().clips();
            counters.gyro_largest_mrad_s = (gyro.rates().largest_rad_s() * 1e3) as i64;
            counters.gyro_spikes = gyro.rates().spikes;
            counters.gyro_fault = self.gyro_check.fault();
            counters.gyro_late_ms = gyro.late_ns() / 1_000_000;
        }
        if let Some(offset) = self.mounting.offset() {
            counters.scans_mounting_off = self.mounting.scans();
            counters.mounting_forward_mm = (offset.forward_m * 1e3) as i64;
            counters.mounting_yaw_mrad = (offset.yaw_rad * 1e3) as i64;
        }
        counters.twists_rejected += self.twist.rejected();
        counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_the_matter_with_wheels_is_said() {
        let text = |wheels_mm_s, true_mm_s| {
            let counters = Counters {
                twist_refused_mm_s: wheels_mm_s,
                twist_true_mm_s: true_mm_s,
                ..Counters::default()
            };
            counters.twist_refused_text()
        };
        assert!(text(0, 800).contains("0.00 m/s where radar or IMU say 0.80 m/s"));
        for (wheels_mm_s, true_mm_s, matter) in [
            (0, 800, "stuck"),
            (-800, 800, "backwards"),
            (1800, 800, "spin"),
            (1000, 0, "spin"),
            (300, 800, "slide"),
        ] {
            let text = text(wheels_mm_s, true_mm_s);
            assert!(text.contains(matter), "{text}");
        }
    }
}

//! What went wrong, counted.

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
    /// Spikes of the gyro's rate, left out.
    pub gyro_spikes: u64,
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
    gyro_spikes,
    frames_reopened,
    solver_failures,
    imu_rejected,
    imu_holes,
    imu_without_gravity,
    imu_gravity_mm_s2,
    points_outside,
} sound has_room);

impl Counters {
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
            self.frames_reopened,
            self.solver_failures,
            self.imu_rejected,
            self.imu_without_gravity,
            self.gyro_spikes,
        ]
        .iter()
        .all(|count| *count <= u64::MAX / 2)
    }
}

impl Counters {
    /// Whether something is wrong with the IMU.
    pub fn has_imu_fault(&self) -> bool {
        self.scans_gyro_refused > 0 || self.imu_without_gravity > 0
    }

    /// What that is, in words and with what to set.
    pub fn imu_text(&self) -> String {
        if self.scans_gyro_refused > 0 {
            let scans = self.scans_gyro_refused;
            format!("{}; {scans} scans without it", self.gyro_fault)
        } else {
            self.gravity_text()
        }
    }

    /// That the acceleration shows no gravity.
    pub fn gravity_text(&self) -> String {
        let shown_m_s2 = self.imu_gravity_mm_s2 as f64 * 1e-3;
        format!("acceleration shows no gravity ({shown_m_s2:.1} m/s2): tilt not used")
    }
}

//! What is said of the gyro's bias for the next scan.

use randt_persist::persist;

/// How the gyro's bias changes from one scan to the next, beside its walk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BiasChange {
    /// Mean, rad/s.
    pub mean_rad_s: f64,
    /// Variance, (rad/s)^2.
    pub variance: f64,
}

persist!(BiasChange {
    mean_rad_s,
    variance
});

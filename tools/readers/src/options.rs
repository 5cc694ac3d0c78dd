//! What the user may set for an input that does not contain it.

/// The instant of a sweep that its stamp means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StampMeaning {
    /// The last beam (the published data set; a driver that stamps when the sweep is complete).
    #[default]
    SweepEnd,
    /// The first beam.
    SweepBegin,
    /// Half way.
    SweepMiddle,
}

impl StampMeaning {
    /// First and last instant of a sweep of this length.
    pub(crate) fn interval(self, stamp_ns: i64, period_ns: i64) -> (i64, i64) {
        let after_ns = match self {
            Self::SweepEnd => 0,
            Self::SweepMiddle => period_ns / 2,
            Self::SweepBegin => period_ns,
        };
        let end_ns = stamp_ns.saturating_add(after_ns);
        (end_ns.saturating_sub(period_ns), end_ns)
    }
}

/// The order in time of a sweep's beams, seen from above.
///
/// Azimuths of a point cloud are right as they are; this sets only which beam was measured first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rotation {
    /// As the points are ordered; counter-clockwise where they are not.
    #[default]
    Auto,
    /// Azimuth grows with time.
    CounterClockwise,
    /// Azimuth falls with time.
    Clockwise,
}

/// Settings of an input. The defaults fit every recording that contains its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Radar topic of a bag; without it the one that can be decoded best, of several such the one
    /// that is named after a radar, then the one with the most messages.
    pub radar_topic: Option<String>,
    /// Field of a point cloud to take for the intensity; without it, it is found by its name.
    pub intensity_field: Option<String>,
    /// Whether a point cloud's azimuths grow clockwise, so that y points right; without it, as in
    /// the clouds of Navtech's driver only.
    pub mirrored: Option<bool>,
    /// IMU topic of a bag; without it the Imu topic with the most messages.
    pub imu_topic: Option<String>,
    /// Topic of a bag with the robot's velocity (Odometry, TwistStamped,
    /// TwistWithCovarianceStamped); none without it, because it may be of another estimate, or the
    /// truth.
    pub twist_topic: Option<String>,
    /// Width of a polar image's range bins, m; without it, as the input says.
    pub bin_size_m: Option<f64>,
    /// What the stamp of a point cloud, or of an image whose rows have none, means.
    pub stamp: StampMeaning,
    /// Sense of rotation of a point cloud's radar.
    pub rotation: Rotation,
    /// Time of one turn, s; without it the median spacing of the stamps.
    pub period_s: Option<f64>,
    /// Polar images: bins with a power above this become returns, in the sensor's unit of 0.5 dB.
    ///
    /// 60 leaves about 30,000 of 1.5 million bins of a Navtech scan: the noise floor is below, and
    /// a filter after this still has three times the returns that it will use.
    pub power_min: f32,
    /// Oxford folders: every image of the folder, also those that `radar.timestamps` does not
    /// list.
    pub unlisted_scans: bool,
    /// Whether an input without a radar is an error (an IMU recording has none).
    pub radar_required: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            radar_topic: None,
            intensity_field: None,
            bin_size_m: None,
            mirrored: None,
            imu_topic: None,
            twist_topic: None,
            stamp: StampMeaning::default(),
            rotation: Rotation::default(),
            period_s: None,
            power_min: 60.0,
            unlisted_scans: false,
            radar_required: true,
        }
    }
}

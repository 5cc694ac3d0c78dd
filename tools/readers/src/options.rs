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
    /// Radar topic of a bag; without it the PointCloud2 topic with the most messages.
    pub radar_topic: Option<String>,
    /// IMU topic of a bag; without it the Imu topic with the most messages.
    pub imu_topic: Option<String>,
    /// Topic of a bag with the robot's velocity (Odometry, TwistStamped,
    /// TwistWithCovarianceStamped); none without it, because it may be of another estimate, or the
    /// truth.
    pub twist_topic: Option<String>,
    /// What a point cloud's stamp means.
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

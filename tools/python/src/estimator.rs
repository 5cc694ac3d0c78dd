//! Odometry step by step, and the registration of two scans.

use crate::configuration::{load, value_error};
use crate::scan::Scan;
use crate::state::{Keyframe, State};
use pyo3::{PyResult, Python, pyclass, pyfunction, pymethods};
use randt_filter::{ClusterFilter, check_sweep};
use randt_geometry::Pose2;
use randt_messages::{
    ImuSample, Keyframe as KeyframeTopic, Message, MessageRef, OdometryState, RadarPoints, Twist,
};
use randt_odometry::{Odometry, Sink};

/// What odometry has published and Python has not taken yet.
#[derive(Default)]
struct Published {
    states: Vec<OdometryState>,
    keyframes: Vec<Message<KeyframeTopic>>,
}

impl Sink for Published {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(*state);
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, KeyframeTopic>) {
        let mut kept = Message::<KeyframeTopic>::default();
        *kept.head = *keyframe.head;
        kept.items.extend_from_slice(keyframe.items);
        self.keyframes.push(kept);
    }
}

/// Filter and odometry.
#[pyclass(module = "randt._randt")]
pub struct Estimator {
    config: randt_config::Config,
    filter: ClusterFilter,
    points: Message<RadarPoints>,
    odometry: Odometry,
    published: Published,
    scans: u64,
    samples: u64,
    twists: u64,
}

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (profile=None, sensor=None, robot=None, set=vec![], use_imu=true, radar_mounting=None, imu_mounting_rad=None))]
    fn new(
        profile: Option<String>,
        sensor: Option<String>,
        robot: Option<String>,
        set: Vec<String>,
        use_imu: bool,
        radar_mounting: Option<[f64; 3]>,
        imu_mounting_rad: Option<[f64; 3]>,
    ) -> PyResult<Self> {
        let mut loaded = load(profile, sensor, None, robot, set)?;
        let mut mounted = loaded.config.robot.clone();
        if let Some([x_m, y_m, yaw_rad]) = radar_mounting {
            (mounted.radar_x_m, mounted.radar_y_m, mounted.radar_yaw_rad) = (x_m, y_m, yaw_rad);
        }
        if let Some([roll, pitch, yaw]) = imu_mounting_rad {
            (
                mounted.imu_roll_rad,
                mounted.imu_pitch_rad,
                mounted.imu_yaw_rad,
            ) = (roll, pitch, yaw);
        }
        loaded.mount(mounted);
        let config = loaded.config;
        Ok(Self {
            filter: ClusterFilter::new(&config.filter, &config.sensor),
            points: Message::default(),
            odometry: Odometry::new(&config, use_imu),
            published: Published::default(),
            config,
            scans: 0,
            samples: 0,
            twists: 0,
        })
    }

    /// The states that this scan completes.
    fn push_scan(&mut self, py: Python<'_>, scan: &Scan) -> PyResult<Vec<State>> {
        check_sweep(&scan.0.head.sweep, &self.config).map_err(value_error)?;
        // Other threads of Python go on meanwhile.
        py.detach(|| {
            self.filter.process(scan.0.as_ref(), &mut self.points);
            self.points.head.scan_sequence = self.scans;
            self.scans += 1;
            let points = self.points.as_ref();
            self.odometry.push_points(points, &mut self.published);
        });
        Ok(self.states())
    }

    fn push_imu(
        &mut self,
        py: Python<'_>,
        stamp_ns: i64,
        rate_rad_s: [f64; 3],
        acceleration_m_s2: [f64; 3],
    ) -> Vec<State> {
        let mut sample = ImuSample {
            rate_rad_s,
            acceleration_m_s2,
            ..ImuSample::default()
        };
        (sample.header.stamp_ns, sample.header.sequence) = (stamp_ns, self.samples);
        self.samples += 1;
        // One sample of a sweep has the estimate to do.
        py.detach(|| self.odometry.push_imu(&sample, &mut self.published));
        self.states()
    }

    fn push_twist(
        &mut self,
        stamp_ns: i64,
        velocity: [f64; 3],
        covariance: [f64; 9],
    ) -> Vec<State> {
        let mut twist = Twist {
            velocity,
            covariance,
            ..Twist::default()
        };
        (twist.header.stamp_ns, twist.header.sequence) = (stamp_ns, self.twists);
        self.twists += 1;
        self.odometry.push_twist(&twist, &mut self.published);
        self.states()
    }

    fn finish(&mut self) -> Vec<State> {
        self.odometry.finish(&mut self.published);
        self.states()
    }

    /// The keyframes since the last call.
    fn keyframes(&mut self) -> Vec<Keyframe> {
        let keyframes = std::mem::take(&mut self.published.keyframes);
        keyframes.into_iter().map(Keyframe).collect()
    }
}

impl Estimator {
    fn states(&mut self) -> Vec<State> {
        let states = std::mem::take(&mut self.published.states);
        states.into_iter().map(State).collect()
    }
}

/// The pose of the second scan's `base_link` in the first one's, and the state that has its
/// covariance.
#[pyfunction]
#[pyo3(signature = (first, second, profile=None, sensor=None, robot=None, set=vec![]))]
pub fn register(
    py: Python<'_>,
    first: &Scan,
    second: &Scan,
    profile: Option<String>,
    sensor: Option<String>,
    robot: Option<String>,
    set: Vec<String>,
) -> PyResult<([f64; 3], State)> {
    let mut estimator = Estimator::new(profile, sensor, robot, set, false, None, None)?;
    let gap_s = (second.0.head.sweep.end_ns - first.0.head.sweep.end_ns) as f64 * 1e-9;
    let gap_max_s = estimator.config.odometry.gap_max_s;
    if gap_s <= 0.0 || gap_s > gap_max_s {
        return Err(value_error(format!(
            "the second scan ends {gap_s:.3} s after the first: from 0 to {gap_max_s} s (odometry.gap_max_s)"
        )));
    }
    let mut states = estimator.push_scan(py, first)?;
    states.extend(estimator.push_scan(py, second)?);
    states.extend(estimator.finish());
    let mut states = states.into_iter();
    let (Some(a), Some(b)) = (states.next(), states.next()) else {
        return Err(value_error("a scan has too few returns to register"));
    };
    let motion = Pose2::from_array(a.0.pose).between(&Pose2::from_array(b.0.pose));
    Ok((motion.to_array(), b))
}

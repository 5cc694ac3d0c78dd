//! The radar's path through a log by odometry, and the gyro's yaw rates.

use super::Recording;
use crate::{final_poses::odometry_poses, job, progress, results::Results};
use anyhow::{bail, ensure};
use nalgebra::Vector3;
use randt_calibration::{RadarPose, Span, YawRate};
use randt_config::{Attitude, Config, Robot};
use randt_filter::{AttitudeFilter, ClusterFilter, check_sweep};
use randt_geometry::{Pose2, Quaternion, elementary::sin_cos};
use randt_messages::{ImuSample, Localizability, Message, OdometryState, RadarPoints, TrustReason};
use randt_odometry::Odometry;
use randt_readers::Event;

/// Accelerations that the motion model allows, m/s^2 and rad/s^2: looser than a pipeline's, whose
/// path is calm, but follows late.
const LOOSE_ACCELERATION_M_S2: f64 = 3.0;
const LOOSE_ANGULAR_ACCELERATION_RAD_S2: f64 = 2.0;
/// Noise of a gyro that does not count for the yaw, rad/s per square root of Hz: it de-skews the
/// sweeps and shows where to begin to search, and the scan decides.
const LOOSE_GYRO_NOISE: f64 = 0.05;
/// Largest cells, m: a calibration drive stays near its walls (a sensor that sees less has its own
/// least).
const CELL_SIZE_MAX_M: f64 = 0.5;
/// Least share of gravity along the robot's vertical (25 degrees): slopes are less, an IMU on its
/// side is more.
const UPRIGHT_MIN: f64 = 0.9;

/// What is asked of odometry.
#[derive(Clone, Copy, Debug)]
pub enum Mode {
    /// The radar by itself: it is `base_link`, and there is no gyro.
    RadarOnly,
    /// The robot as configured, without its gyro.
    WithoutGyro,
    /// The gyro, its stamps made later by this, ns, de-skews the sweeps.
    DeskewedByGyro(i64),
}

/// What a log holds for calibration.
pub struct Path {
    /// The poses.
    pub poses: Vec<RadarPose>,
    /// The gyro's yaw rates by its own stamps.
    pub rates: Vec<YawRate>,
    /// The robot as configured or as in the log.
    pub robot: Robot,
    /// Whether data were lost on the way.
    pub lost: bool,
    /// Stamp of the first scan, ns.
    begin_ns: i64,
}

/// The rate of the heading from the IMU's samples: tilt taken out, bias left in.
struct YawRateEstimator {
    mounting: Quaternion,
    attitude: AttitudeFilter,
    force: Vector3<f64>,
    rates: Vec<YawRate>,
}

impl Path {
    /// Reads a log to its end.
    pub fn read(recording: &Recording, mode: Mode) -> anyhow::Result<Self> {
        job::catch_interrupts();
        let log = recording.log.display();
        let mut source = randt_readers::open(&recording.log, &recording.options.options())?;
        let loaded = recording.selection.load(source.info().sensor.name())?;
        let mut config = job::fit_input(loaded, source.as_mut())?.config;
        let robot = config.robot.clone();
        let mut yaw_rates = YawRateEstimator::new(&robot, &config.attitude);
        mode.prepare(&mut config);
        let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
        let mut points = Message::<RadarPoints>::default();
        let mut odometry = Odometry::new(&config, matches!(mode, Mode::DeskewedByGyro(_)));
        let mut results = Results::default();
        let (mut misfits, mut first_misfit) = (0u64, None);
        let bar = progress::bar(source.info().scans, "scans");
        while let Some(event) = source.next_event()? {
            ensure!(!job::interrupted(), "interrupted");
            match event {
                Event::Scan(scan) => {
                    bar.inc(1);
                    if let Err(misfit) = check_sweep(&scan.head.sweep, &config) {
                        misfits += 1;
                        first_misfit.get_or_insert(misfit);
                        continue;
                    }
                    filter.process(scan.as_ref(), &mut points);
                    odometry.push_points(points.as_ref(), &mut results);
                }
                Event::Imu(mut sample) => {
                    yaw_rates.push(&sample);
                    if let Mode::DeskewedByGyro(late_ns) = mode {
                        sample.header.stamp_ns += late_ns;
                        odometry.push_imu(&sample, &mut results);
                    }
                }
                Event::Twist(_) | Event::Truth(_) => {}
            }
        }
        odometry.finish(&mut results);
        bar.finish_and_clear();
        let Some(first) = results.states.first() else {
            match first_misfit {
                Some(misfit) => return Err(misfit.into()),
                None => bail!("{log}: holds no scan that could be used"),
            }
        };
        if let Some(misfit) = first_misfit {
            eprintln!("warning: {misfits} scans were left out: {misfit}");
        }
        let counters = source.counters();
        for counter in &counters {
            let (count, name, first) = (counter.count, counter.name, &counter.first);
            eprintln!("warning: {count} {name}: {first}");
        }
        Ok(Self {
            begin_ns: first.header.stamp_ns,
            poses: poses(&results.states),
            rates: yaw_rates.rates(&recording.log)?,
            robot,
            lost: misfits > 0 || counters.iter().any(|counter| counter.loss),
        })
    }

    /// A span in seconds from the log's first scan.
    pub fn seconds(&self, span: &Span) -> [f64; 2] {
        [span.begin_ns, span.end_ns].map(|stamp_ns| (stamp_ns - self.begin_ns) as f64 * 1e-9)
    }
}

impl Mode {
    fn prepare(self, config: &mut Config) {
        // The log's own stamps are what is asked about.
        config.odometry.radar_late_s = 0.0;
        config.ndt.cell_size_m = config.ndt.cell_size_m.min(CELL_SIZE_MAX_M);
        match self {
            Self::RadarOnly => {
                (config.robot.radar_x_m, config.robot.radar_y_m) = (0.0, 0.0);
                config.robot.radar_yaw_rad = 0.0;
                // A radar off the robot's axis moves sideways as well as forward.
                config.odometry.lateral_acceleration_sigma_m_s2 =
                    config.odometry.acceleration_sigma_m_s2;
            }
            Self::WithoutGyro => {}
            Self::DeskewedByGyro(_) => {
                config.odometry.acceleration_sigma_m_s2 = LOOSE_ACCELERATION_M_S2;
                config.odometry.lateral_acceleration_sigma_m_s2 = LOOSE_ACCELERATION_M_S2;
                config.odometry.angular_acceleration_sigma_rad_s2 =
                    LOOSE_ANGULAR_ACCELERATION_RAD_S2;
                config.odometry.gyro_noise_rad_s_sqrt_hz = LOOSE_GYRO_NOISE;
            }
        }
    }
}

impl YawRateEstimator {
    fn new(robot: &Robot, attitude: &Attitude) -> Self {
        let (roll, pitch, yaw) = (robot.imu_roll_rad, robot.imu_pitch_rad, robot.imu_yaw_rad);
        Self {
            mounting: Quaternion::from_roll_pitch_yaw(roll, pitch, yaw),
            attitude: AttitudeFilter::new(attitude),
            force: Vector3::zeros(),
            rates: Vec::new(),
        }
    }

    fn push(&mut self, sample: &ImuSample) {
        let rate = self.mounting.rotate(sample.rate_rad_s.into());
        let force = self.mounting.rotate(sample.acceleration_m_s2.into());
        self.attitude.push(sample.header.stamp_ns, rate, force);
        let (roll, pitch, _) = self.attitude.attitude().roll_pitch_yaw();
        let ((sin_roll, cos_roll), (_, cos_pitch)) = (sin_cos(roll), sin_cos(pitch));
        if force.iter().all(|v| v.is_finite()) {
            self.force += force;
        }
        self.rates.push(YawRate {
            stamp_ns: sample.header.stamp_ns,
            rate_rad_s: (rate.y * sin_roll + rate.z * cos_roll) / cos_pitch,
        });
    }

    /// The rates, if the IMU sits upright on the robot: what a drive accelerates it brakes again,
    /// so that the mean force is gravity's.
    fn rates(self, log: &std::path::Path) -> anyhow::Result<Vec<YawRate>> {
        let up = self.force.try_normalize(1e-9);
        ensure!(
            !up.is_some_and(|up| up.z < UPRIGHT_MIN),
            "{}: gravity is not along the robot's vertical: set [robot] imu_roll_rad and imu_pitch_rad, which `randt-lab imu` finds",
            log.display()
        );
        Ok(self.rates)
    }
}

/// Whether the scan itself fixes the step to the next one: that the position has drifted some
/// metres ago, which trust remembers, does not matter here.
fn is_fixed(state: &OdometryState) -> bool {
    let reasons = state.trust_reasons & !(TrustReason::Held as u32);
    state.localizability() == Localizability::Full && reasons == 0
}

fn poses(states: &[OdometryState]) -> Vec<RadarPose> {
    let pose = |(state, pose): (&OdometryState, Pose2)| RadarPose {
        stamp_ns: state.header.stamp_ns,
        frame: state.odom_frame_id,
        pose,
        fixed: is_fixed(state),
    };
    states
        .iter()
        .zip(odometry_poses(states))
        .map(pose)
        .collect()
}

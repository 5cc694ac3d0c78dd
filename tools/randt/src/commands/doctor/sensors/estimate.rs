//! What odometry makes of the sensors: the same code as in a drive, which compares radar, gyro and
//! wheels.

use crate::commands::doctor::finding::Finding;
use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_geometry::elementary::wrap;
use randt_messages::{
    ImuSample, Keyframe, Message, MessageRef, OdometryState, RadarPoints, RadarScan, Trust, Twist,
};
use randt_odometry::{Counters, GyroFault, Odometry, Sink};

/// Scans from which odometry has something to say.
const SCANS_MIN: u64 = 10;
/// A turn in which a gyro that lies differs from the radar, rad: 60 degrees.
const TURNED_MIN_RAD: f64 = 1.05;
/// Shares of the radar's turns, thousandths, that a sound gyro shows where stamps come tens of
/// milliseconds off.
const NEARLY_RIGHT: std::ops::Range<i64> = 700..1_300;

/// Whether a sound gyro shows this where stamps are off, as in the first seconds of a driver on a
/// busy machine: then it is doubtful, not bad.
fn may_be_of_stamps(fault: GyroFault) -> bool {
    match fault {
        GyroFault::Scaled(permille) => NEARLY_RIGHT.contains(&permille),
        GyroFault::Disagrees | GyroFault::Biased(_) | GyroFault::Delayed(_) => true,
        _ => false,
    }
}

/// Filter and odometry, fed with what comes.
pub struct LiveEstimate {
    filter: ClusterFilter,
    points: Message<RadarPoints>,
    odometry: Odometry,
    motion: Motion,
}

/// What the states show.
#[derive(Default)]
struct Motion {
    scans: u64,
    lost: u64,
    last_yaw_rad: Option<f64>,
    turned_rad: f64,
}

impl Sink for Motion {
    fn state(&mut self, state: &OdometryState) {
        let [_, _, yaw_rad] = state.pose;
        let last_yaw_rad = self.last_yaw_rad.replace(yaw_rad).unwrap_or(yaw_rad);
        self.turned_rad += wrap(yaw_rad - last_yaw_rad).abs();
        self.scans += 1;
        self.lost += u64::from(state.trust() == Trust::Lost);
    }

    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

impl LiveEstimate {
    pub fn new(config: &Config, use_imu: bool) -> Self {
        Self {
            filter: ClusterFilter::new(&config.filter, &config.sensor),
            points: Message::default(),
            odometry: Odometry::new(config, use_imu),
            motion: Motion::default(),
        }
    }

    pub fn push_scan(&mut self, scan: MessageRef<'_, RadarScan>) {
        self.filter.process(scan, &mut self.points);
        let points = self.points.as_ref();
        self.odometry.push_points(points, &mut self.motion);
    }

    pub fn push_imu(&mut self, sample: &ImuSample) {
        self.odometry.push_imu(sample, &mut self.motion);
    }

    pub fn push_twist(&mut self, twist: &Twist) {
        self.odometry.push_twist(twist, &mut self.motion);
    }

    /// What it found. `twists`: how many came.
    pub fn check(&self, twists: usize) -> Vec<Finding> {
        if self.motion.scans < SCANS_MIN {
            return Vec::new();
        }
        check(&self.odometry.counters(), &self.motion, twists)
    }
}

fn check(counters: &Counters, motion: &Motion, twists: usize) -> Vec<Finding> {
    let mut found = Vec::new();
    let turned_deg = motion.turned_rad.to_degrees();
    if counters.scans_gyro_refused > 0 {
        let text = counters.gyro_fault.to_string();
        // What is wrong, and what to set, where that is known.
        let (text, fix) = match text.split_once(": ") {
            Some((text, fix)) => (text.to_owned(), fix.to_owned()),
            None => (
                text,
                "turn the robot to and fro, with --seconds 30: turns show how".into(),
            ),
        };
        found.push(match counters.gyro_fault {
            fault if may_be_of_stamps(fault) => {
                let fix =
                    format!("{fix}; stamps are rough in a driver's first seconds: --seconds 30");
                Finding::warn("gyro", text, fix)
            }
            _ => Finding::bad("gyro", text, fix),
        });
    } else if counters.scans_gyro_shifted > 0 {
        let fix =
            "randt calibrate time; stamps are rough in a driver's first seconds: --seconds 30";
        found.push(Finding::warn("gyro", counters.shifted_text(), fix));
    } else if counters.gyro_bias_changes > 0 {
        let fix = "let the IMU warm up, and stand still for two seconds before the drive";
        found.push(Finding::warn("gyro", counters.bias_text(), fix));
    } else if motion.turned_rad > TURNED_MIN_RAD {
        let text = format!("agrees with the radar over turns of {turned_deg:.0} degrees");
        found.push(Finding::ok("gyro", text));
    }
    if motion.lost > 0 {
        let text = format!("lost in {} of {} scans", motion.lost, motion.scans);
        let fix = "walls in reach? Is the sensor file the radar's (sensor.name), and its place (robot.radar_x_m)?";
        found.push(Finding::warn("odometry", text, fix));
    }
    // Until it was refused, a gyro that lies has judged the wheels.
    if counters.scans_gyro_refused > 0 {
        return found;
    }
    if counters.scans_twist_refused > 0 {
        let fix = "check the wheels' scale, sign and unit (m/s, rad/s), and whether they come from this robot";
        found.push(Finding::bad("wheels", counters.twist_refused_text(), fix));
    } else if twists > 0 {
        let text = format!("{twists} velocities, none against radar and IMU");
        found.push(Finding::ok("wheels", text));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_simulator::{Event, Robot, Simulation, World};

    /// What is found in half a minute of a drive whose samples are changed.
    fn found(change: impl Fn(&mut ImuSample)) -> String {
        let mut config = Config::default();
        config.robot.radar_x_m = Robot::default().radar_mounting.x_m;
        let mut estimate = LiveEstimate::new(&config, true);
        let mut twists = 0;
        for event in Simulation::new(&World::building(), Robot::default(), 150, 5) {
            match event {
                Event::Scan(scan) => estimate.push_scan(scan.as_ref()),
                Event::Imu(mut sample) => {
                    change(&mut sample);
                    estimate.push_imu(&sample);
                }
                Event::Twist(twist) => {
                    twists += 1;
                    estimate.push_twist(&twist);
                }
                Event::Truth(_) => {}
            }
        }
        let found = estimate.check(twists);
        found.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_gyro_that_turns_the_other_way_is_bad_and_a_sound_one_is_not() {
        let sound = found(|_| ());
        assert!(
            sound.starts_with("ok    gyro       agrees with the radar"),
            "{sound}"
        );
        let opposite = found(|sample| sample.rate_rad_s[2] *= -1.0);
        assert!(
            opposite.contains("BAD   gyro       gyro and radar turn opposite ways"),
            "{opposite}"
        );
        assert!(
            opposite.contains("fix it:    the gyro's sign or axis"),
            "{opposite}"
        );
    }

    #[test]
    fn a_fault_without_a_remedy_asks_for_turns_and_wheels_are_named() {
        let text = |scans_gyro_refused| -> String {
            let counters = Counters {
                scans_gyro_refused,
                gyro_fault: GyroFault::Disagrees,
                scans_twist_refused: 3,
                twist_true_mm_s: 800,
                ..Counters::default()
            };
            let found = check(&counters, &Motion::default(), 9);
            found.iter().map(ToString::to_string).collect()
        };
        let nearly = Counters {
            scans_gyro_refused: 9,
            gyro_fault: GyroFault::Scaled(820),
            ..Counters::default()
        };
        let nearly: String = check(&nearly, &Motion::default(), 0)
            .iter()
            .map(ToString::to_string)
            .collect();
        assert!(
            nearly.starts_with("WARN  gyro       the gyro turns 0.82 times"),
            "{nearly}"
        );
        let wheels = text(0);
        assert!(
            wheels.contains("BAD   wheels") && wheels.contains("stuck"),
            "{wheels}"
        );
        // A gyro that lies is no judge of them.
        let gyro = text(1);
        assert!(
            gyro.contains("turn the robot to and fro") && !gyro.contains("wheels"),
            "{gyro}"
        );
    }
}

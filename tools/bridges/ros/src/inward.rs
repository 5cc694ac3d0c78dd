//! From ROS to the pipeline: sweeps, IMU samples and twists, as drivers publish them.

use randt::output::head_only;
use randt_config::Robot;
use randt_geometry::{Pose2, Quaternion};
use randt_messages::{ImuSampleTopic, RadarScan, TwistTopic};
use randt_readers::{Encoding, Event, LiveRos, Options};
use randt_stage::{Error, Publisher, Stage};
use std::time::{Duration, Instant};

/// Where ROS and the configuration agree on the mounting, m and rad.
const SAME: f64 = 0.01;
/// A sensor that says nothing for longer is named: the slowest radar of ours turns in 0.25 s.
const SILENCE_MAX: Duration = Duration::from_secs(2);

/// The drivers' topics.
pub struct Inward {
    live: LiveRos,
    scans: Publisher<RadarScan>,
    samples: Publisher<ImuSampleTopic>,
    twists: Publisher<TwistTopic>,
    /// The sensors' topics of ROS, and when each was heard; wheels may be away.
    heard: Vec<(String, Instant)>,
    /// Messages that could not be taken, and why the first one.
    refused: (u64, Option<String>),
}

impl Inward {
    /// Opens the topics. `encoding`: how ROS serialises.
    pub fn open(stage: &mut Stage, encoding: Encoding, options: Options) -> Result<Self, Error> {
        let sensors = [&options.radar_topic, &options.imu_topic];
        let sensors = sensors.into_iter().flatten();
        Ok(Self {
            heard: sensors.map(|it| (it.clone(), Instant::now())).collect(),
            live: LiveRos::new(encoding, options),
            scans: stage.publisher()?,
            samples: stage.publisher()?,
            twists: stage.publisher()?,
            refused: (0, None),
        })
    }

    /// Takes a message that came at an instant, and publishes what it gives.
    pub fn take(
        &mut self,
        topic: &str,
        type_name: &str,
        arrival_ns: i64,
        bytes: Vec<u8>,
    ) -> Result<(), Error> {
        for (name, heard) in &mut self.heard {
            if name == topic {
                *heard = Instant::now();
            }
        }
        self.live.push(topic, type_name, arrival_ns, bytes);
        loop {
            match self.live.next_event() {
                Ok(Some(Event::Scan(scan))) => self.scans.publish(scan.as_ref())?,
                Ok(Some(Event::Imu(sample))) => self.samples.publish(head_only(&sample))?,
                Ok(Some(Event::Twist(twist))) => self.twists.publish(head_only(&twist))?,
                Ok(Some(Event::Truth(_))) => {}
                Ok(None) => return Ok(()),
                Err(error) => {
                    self.refused.0 += 1;
                    self.refused.1.get_or_insert_with(|| error.to_string());
                    return Ok(());
                }
            }
        }
    }

    /// What was lost.
    pub fn lost(&self) -> u64 {
        let counters = self.live.counters();
        let losses = counters.iter().filter(|counter| counter.loss);
        losses.map(|counter| counter.count).sum::<u64>() + self.refused.0
    }

    /// What is wrong, the worst first.
    pub fn problem(&self, robot: &Robot) -> Option<String> {
        let silent = self
            .heard
            .iter()
            .find(|(_, heard)| heard.elapsed() > SILENCE_MAX);
        let silent = silent.map(|(topic, _)| {
            format!(
                "no message on {topic} for more than {} s",
                SILENCE_MAX.as_secs()
            )
        });
        let refused = || self.refused.1.clone();
        silent
            .or_else(refused)
            .or_else(|| self.mounting(robot))
            .or_else(|| self.first_losses())
    }

    /// The first case of each kind of loss.
    fn first_losses(&self) -> Option<String> {
        let counters = self.live.counters();
        let losses = counters.iter().filter(|counter| counter.loss);
        let first = losses.map(|it| format!("{} (first: {})", it.name, it.first));
        first.reduce(|all, one| format!("{all}; {one}"))
    }

    /// What the configuration would have to be by ROS's transforms, where it is something else:
    /// the stages compute by the configuration.
    fn mounting(&self, it: &Robot) -> Option<String> {
        let extrinsics = self.live.extrinsics()?;
        let configured = Pose2::new(it.radar_x_m, it.radar_y_m, it.radar_yaw_rad);
        let radar = extrinsics.radar.filter(|radar| differs(&configured, radar));
        let configured =
            Quaternion::from_roll_pitch_yaw(it.imu_roll_rad, it.imu_pitch_rad, it.imu_yaw_rad);
        let imu = extrinsics.imu.filter(|imu| turned(&configured, imu));
        let radar = radar.map(|radar| {
            format!(
                "robot.radar_x_m = {:.3}, radar_y_m = {:.3}, radar_yaw_rad = {:.4}",
                radar.x_m, radar.y_m, radar.yaw_rad
            )
        });
        let imu = imu.map(|imu| {
            let (roll_rad, pitch_rad, yaw_rad) = imu.roll_pitch_yaw();
            format!(
                "robot.imu_roll_rad = {roll_rad:.4}, imu_pitch_rad = {pitch_rad:.4}, imu_yaw_rad = {yaw_rad:.4}"
            )
        });
        let wanted = [radar, imu].into_iter().flatten();
        let wanted = wanted.reduce(|all, one| format!("{all}; {one}"))?;
        Some(format!(
            "ROS's transforms have another mounting than the configuration: {wanted}"
        ))
    }
}

fn differs(a: &Pose2, b: &Pose2) -> bool {
    let between = a.between(b);
    between.translation().norm() > SAME || between.yaw_rad.abs() > SAME
}

/// Whether one is the other one turned.
fn turned(a: &Quaternion, b: &Quaternion) -> bool {
    let products = a.to_array().into_iter().zip(b.to_array());
    let cosine = products.map(|(a, b)| a * b).sum::<f64>().abs();
    // Of half the angle: 1 - angle^2 / 8.
    cosine < 1.0 - SAME * SAME / 8.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn two_names_of_one_rotation_are_the_same_mounting() {
        let rotation = Quaternion::from_roll_pitch_yaw;
        assert!(!turned(&rotation(PI, 0.0, 0.0), &rotation(-PI, 0.0, 0.0)));
        let [one, other] = [rotation(0.3, FRAC_PI_2, 0.1), rotation(0.2, FRAC_PI_2, 0.0)];
        assert!(!turned(&one, &other));
        assert!(turned(&rotation(0.0, 0.0, 0.0), &rotation(0.0, 0.0, 0.02)));
        let pose = |yaw_rad| Pose2::new(1.0, 2.0, yaw_rad);
        assert!(!differs(&pose(PI), &pose(-PI)));
        assert!(differs(&pose(0.0), &pose(0.02)));
        assert!(differs(&pose(0.0), &Pose2::new(1.02, 2.0, 0.0)));
    }
}

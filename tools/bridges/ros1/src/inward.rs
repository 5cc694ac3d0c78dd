//! From ROS to the pipeline: sweeps, IMU samples and twists, as drivers publish them.

use crate::frame::Frame;
use randt::output::head_only;
use randt_config::Robot;
use randt_messages::{ImuSampleTopic, RadarScan, TwistTopic};
use randt_readers::{Event, Extrinsics, LiveRos, Options};
use randt_stage::{Error, Publisher, Stage};

/// Where ROS and the configuration agree on the mounting, m and rad.
const SAME: f64 = 0.01;

/// The drivers' topics.
pub struct Inward {
    live: LiveRos,
    scans: Publisher<RadarScan>,
    samples: Publisher<ImuSampleTopic>,
    twists: Publisher<TwistTopic>,
}

impl Inward {
    /// Opens the topics.
    pub fn open(stage: &mut Stage, options: Options) -> Result<Self, Error> {
        Ok(Self {
            live: LiveRos::new(options),
            scans: stage.publisher()?,
            samples: stage.publisher()?,
            twists: stage.publisher()?,
        })
    }

    /// Takes a message, and publishes what it gives.
    pub fn take(&mut self, frame: Frame) -> anyhow::Result<()> {
        self.live
            .push(&frame.topic, &frame.type_name, frame.time_ns, frame.message);
        while let Some(event) = self.live.next_event()? {
            match event {
                Event::Scan(scan) => self.scans.publish(scan.as_ref())?,
                Event::Imu(sample) => self.samples.publish(head_only(&sample))?,
                Event::Twist(twist) => self.twists.publish(head_only(&twist))?,
                Event::Truth(_) => {}
            }
        }
        Ok(())
    }

    /// What was lost, and the first case of each kind.
    pub fn lost(&self) -> (u64, Option<String>) {
        let counters = self.live.counters();
        let losses = counters.iter().filter(|counter| counter.loss);
        let count = losses.clone().map(|counter| counter.count).sum();
        let first = losses.map(|it| format!("{} (first: {})", it.name, it.first));
        (count, first.reduce(|all, one| format!("{all}; {one}")))
    }

    /// What the mounting in ROS's static transforms has to be in the configuration, where it is
    /// not: the stages compute by the configuration.
    pub fn mounting(&self, robot: &Robot) -> Option<String> {
        let extrinsics = self.live.extrinsics()?;
        let wanted = settings(&extrinsics);
        let differs = |(key, value): &&(&str, f64)| {
            let configured = match *key {
                "radar_x_m" => robot.radar_x_m,
                "radar_y_m" => robot.radar_y_m,
                "radar_yaw_rad" => robot.radar_yaw_rad,
                "imu_roll_rad" => robot.imu_roll_rad,
                "imu_pitch_rad" => robot.imu_pitch_rad,
                _ => robot.imu_yaw_rad,
            };
            (configured - value).abs() > SAME
        };
        let wanted = wanted.iter().filter(differs);
        let wanted = wanted.map(|(key, value)| format!("robot.{key} = {value:.3}"));
        let wanted = wanted.reduce(|all, one| format!("{all}, {one}"))?;
        Some(format!(
            "tf_static has another mounting than the configuration: {wanted}"
        ))
    }
}

fn settings(extrinsics: &Extrinsics) -> Vec<(&'static str, f64)> {
    let mut settings = Vec::new();
    if let Some(radar) = extrinsics.radar {
        settings.push(("radar_x_m", radar.x_m));
        settings.push(("radar_y_m", radar.y_m));
        settings.push(("radar_yaw_rad", radar.yaw_rad));
    }
    if let Some(imu) = extrinsics.imu {
        let (roll_rad, pitch_rad, yaw_rad) = imu.roll_pitch_yaw();
        settings.push(("imu_roll_rad", roll_rad));
        settings.push(("imu_pitch_rad", pitch_rad));
        settings.push(("imu_yaw_rad", yaw_rad));
    }
    settings
}

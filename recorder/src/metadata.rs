//! The metadata at the beginning of a log, and how its channels are declared.

use randt_config::{Config, Loaded};
use randt_foxglove_schemas::topic::recorded_channels;
use randt_geometry::Quaternion;
use randt_log::{CONFIG_METADATA, CONFIG_TOML, Channel, ROBOT_METADATA, Robot, channels};
use randt_messages::SensorKind;
use std::collections::BTreeMap;
use std::fs;

/// Stages and their versions.
pub const VERSIONS_METADATA: &str = "randt/versions";
/// Layout of every topic.
pub const LAYOUTS_METADATA: &str = "randt/layouts";
/// The machine.
pub const MACHINE_METADATA: &str = "randt/machine";
/// How stamps become dates.
pub const CLOCK_METADATA: &str = "randt/clock";

type Fields = BTreeMap<String, String>;

/// The channel of a topic, of ours or for viewers; an unknown one has no schema.
pub(crate) fn channel_of(topic: &str) -> Channel {
    let ours = randt_log::channel_of(topic);
    let for_viewers = || {
        recorded_channels()
            .into_iter()
            .find(|known| known.topic == topic)
    };
    let known = ours.or_else(for_viewers);
    known.unwrap_or_default()
}

/// What follows from the configuration: how to read the log again. It is the same in every file of
/// a run.
pub fn configuration_records(loaded: &Loaded) -> Vec<(&'static str, Fields)> {
    let layouts = channels()
        .into_iter()
        .map(|c| (c.topic.clone(), c.layout().to_owned()));
    vec![
        (ROBOT_METADATA, robot(&loaded.config).to_metadata()),
        (CONFIG_METADATA, fields([(CONFIG_TOML, loaded.to_toml())])),
        (LAYOUTS_METADATA, layouts.collect()),
    ]
}

/// The machine: it may explain why a run was slow.
pub fn machine_record() -> (&'static str, Fields) {
    let text = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let line = |path: &str| text(path).trim().to_owned();
    let processors = std::thread::available_parallelism().map_or(0, usize::from);
    let cpuinfo = text("/proc/cpuinfo");
    let mut lines = cpuinfo.lines();
    let model = lines.find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let fields = fields([
        ("host", line("/proc/sys/kernel/hostname")),
        ("system", std::env::consts::OS.to_owned()),
        ("architecture", std::env::consts::ARCH.to_owned()),
        ("kernel", line("/proc/sys/kernel/osrelease")),
        ("boot_id", line("/proc/sys/kernel/random/boot_id")),
        ("processor", model.unwrap_or_default().1.to_owned()),
        ("processors", processors.to_string()),
    ]);
    (MACHINE_METADATA, fields)
}

/// Pairs as a record.
pub fn fields<const N: usize>(pairs: [(&str, String); N]) -> Fields {
    pairs.map(|(key, value)| (key.to_owned(), value)).into()
}

/// The robot as `randt run LOG` reads it.
fn robot(config: &Config) -> Robot {
    let (it, name) = (&config.robot, config.sensor.name.as_str());
    let mut kinds = [SensorKind::IsdrC, SensorKind::NavtechCts].into_iter();
    let kind = kinds.find(|kind| kind.name() == Some(name));
    let imu = Quaternion::from_roll_pitch_yaw(it.imu_roll_rad, it.imu_pitch_rad, it.imu_yaw_rad);
    Robot {
        sensor: kind.unwrap_or(SensorKind::Unknown),
        radar: Some([it.radar_x_m, it.radar_y_m, it.radar_yaw_rad]),
        imu: Some(imu.to_array()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Selection;

    #[test]
    fn every_topic_of_the_bus_has_its_channel() {
        let known = channels();
        for topic in randt_messages::BUS_TOPICS {
            let channel = known.iter().find(|c| c.topic == topic.name).unwrap();
            assert_eq!(channel.layout(), topic.type_name);
            assert_eq!(&channel_of(topic.name), channel);
        }
    }

    #[test]
    fn the_mounting_reads_back() {
        let set = vec![
            "robot.radar_x_m=0.3".to_owned(),
            "robot.imu_roll_rad=3.0".to_owned(),
        ];
        let selection = Selection {
            set,
            ..Selection::default()
        };
        let loaded = Config::load(&selection).unwrap();
        let records = configuration_records(&loaded);
        let robot = Robot::from_metadata(&records[0].1, "x").unwrap();
        assert_eq!(robot.sensor, SensorKind::IsdrC);
        assert_eq!(robot.radar, Some([0.3, 0.0, 0.0]));
        let [w, x, y, z] = robot.imu.unwrap();
        let (roll, ..) = Quaternion::new(w, x, y, z).roll_pitch_yaw();
        assert!((roll - 3.0).abs() < 1e-12);
        assert!(records[1].1["toml"].contains("radar_x_m = 0.3"));
    }
}

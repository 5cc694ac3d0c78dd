//! The options for what an input does not contain itself, shared by every command that reads one.

use clap::{ValueEnum, builder::PossibleValue};
use randt_readers::{Options, Rotation, StampMeaning};
use std::ops::RangeBounds;

/// Settings of the input; what is not given is found from the data.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Input")]
pub struct InputOptions {
    /// Radar topic of a bag; if not given, the one that can be decoded best and is named after a
    /// radar, then the one with the most messages
    #[arg(long, value_name = "NAME")]
    radar_topic: Option<String>,
    /// Field of a point cloud that is the intensity; if not given, found by its name
    #[arg(long, value_name = "NAME")]
    intensity_field: Option<String>,
    /// Whether a point cloud counts azimuths clockwise, so that y points right; if not given, only
    /// Navtech's driver does
    #[arg(long, value_name = "WHETHER", default_value = "auto")]
    mirrored: Mirrored,
    /// Polar images: width of a range bin, m; if not given, sensor.range_resolution_m
    #[arg(long, value_name = "M", value_parser = bin_size)]
    bin_size: Option<f64>,
    /// IMU topic of a bag; if not given, the Imu topic with the most messages
    #[arg(long, value_name = "NAME")]
    imu_topic: Option<String>,
    /// Topic of a bag with the velocity by wheels (Odometry, TwistStamped,
    /// TwistWithCovarianceStamped); none if not given: it may be the truth, or another estimate
    #[arg(long, value_name = "NAME")]
    twist_topic: Option<String>,
    /// The instant of a sweep that the stamp of a point cloud, or of an image without times, means
    #[arg(long, value_name = "WHEN", default_value = "end")]
    stamp: Stamp,
    /// Order in time of a point cloud's beams, seen from above; if not given, as the points are
    /// ordered
    #[arg(long, value_name = "SENSE", default_value = "auto")]
    rotation: Turning,
    /// Time of one turn, s; if not given, the median spacing of the stamps
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    period: Option<f64>,
    /// Polar images: power above which a bin becomes a return, in the sensor's unit of 0.5 dB
    #[arg(long, value_name = "POWER", default_value_t = Options::default().power_min)]
    power_min: f32,
    /// Polar images: also those that radar.timestamps does not list
    #[arg(long)]
    all_images: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Stamp {
    /// The first beam
    Begin,
    /// Half way
    Middle,
    /// The last beam
    End,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Mirrored {
    /// As the driver is known to
    Auto,
    /// Clockwise: y is turned
    Yes,
    /// Counter-clockwise
    No,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Turning {
    /// As the points are ordered
    Auto,
    /// Counter-clockwise
    Ccw,
    /// Clockwise
    Cw,
}

impl Default for InputOptions {
    fn default() -> Self {
        Self {
            radar_topic: None,
            intensity_field: None,
            mirrored: Mirrored::Auto,
            bin_size: None,
            imu_topic: None,
            twist_topic: None,
            stamp: Stamp::End,
            rotation: Turning::Auto,
            period: None,
            power_min: Options::default().power_min,
            all_images: false,
        }
    }
}

impl InputOptions {
    /// The same as arguments of another command.
    pub fn as_arguments(&self) -> Vec<String> {
        let name = |value: PossibleValue| value.get_name().to_owned();
        let mut arguments = vec![format!("--power-min={}", self.power_min)];
        for (option, value) in [
            ("--stamp", self.stamp.to_possible_value().map(name)),
            ("--rotation", self.rotation.to_possible_value().map(name)),
            ("--mirrored", self.mirrored.to_possible_value().map(name)),
            ("--radar-topic", self.radar_topic.clone()),
            ("--intensity-field", self.intensity_field.clone()),
            ("--bin-size", self.bin_size.map(|size| size.to_string())),
            ("--imu-topic", self.imu_topic.clone()),
            ("--twist-topic", self.twist_topic.clone()),
            ("--period", self.period.map(|period| period.to_string())),
        ] {
            arguments.extend(value.map(|value| format!("{option}={value}")));
        }
        if self.all_images {
            arguments.push("--all-images".to_owned());
        }
        arguments
    }

    /// Those of them that are not as they are when nothing is given.
    pub fn given(&self) -> Vec<String> {
        let usual = Self::default().as_arguments();
        let mut arguments = self.as_arguments();
        arguments.retain(|argument| !usual.contains(argument));
        arguments
    }

    /// The readers' options.
    pub fn options(&self) -> Options {
        Options {
            radar_topic: self.radar_topic.clone(),
            intensity_field: self.intensity_field.clone(),
            mirrored: match self.mirrored {
                Mirrored::Auto => None,
                Mirrored::Yes => Some(true),
                Mirrored::No => Some(false),
            },
            bin_size_m: self.bin_size,
            imu_topic: self.imu_topic.clone(),
            twist_topic: self.twist_topic.clone(),
            stamp: match self.stamp {
                Stamp::Begin => StampMeaning::SweepBegin,
                Stamp::Middle => StampMeaning::SweepMiddle,
                Stamp::End => StampMeaning::SweepEnd,
            },
            rotation: match self.rotation {
                Turning::Auto => Rotation::Auto,
                Turning::Ccw => Rotation::CounterClockwise,
                Turning::Cw => Rotation::Clockwise,
            },
            period_s: self.period,
            power_min: self.power_min,
            unlisted_scans: self.all_images,
            ..Options::default()
        }
    }
}

/// A number of an option, if it is within a range that `expected` describes.
pub fn number_within(
    text: &str,
    range: impl RangeBounds<f64>,
    expected: &str,
) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("expected {expected}"))
}

/// A time that a radar can turn in.
fn positive(text: &str) -> Result<f64, String> {
    number_within(text, 0.005..=60.0, "seconds between 0.005 and 60")
}

/// A width that a range bin can have.
fn bin_size(text: &str) -> Result<f64, String> {
    number_within(text, 0.001..=10.0, "metres between 0.001 and 10")
}

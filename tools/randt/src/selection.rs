//! The options that choose a configuration, shared by every command that needs one.

use randt_config::{Config, DEFAULT_PROFILE, Loaded, Selection};
use randt_messages::SensorKind;

/// Options that choose a configuration.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SelectionArguments {
    /// Environment: mixed (if not given), indoor, outdoor, oxford, or a file
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
    /// Radar: isdr-c, navtech-cts, or a file; if not given, it follows from the input
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// Where the sensors sit on the robot; if not given, as the input says
    #[arg(long, value_name = "FILE")]
    robot: Option<String>,
    /// Set one key, such as ndt.cell_size_m=0.5; may be given several times
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    set: Vec<String>,
}

impl SelectionArguments {
    /// The same with more keys set, over those that the user has set.
    pub fn with(&self, set: &[&str]) -> Self {
        let mut with = self.clone();
        with.set.extend(set.iter().map(|text| (*text).to_owned()));
        with
    }

    /// What was chosen, in a line.
    pub fn description(&self) -> String {
        let profile = self.profile.as_deref().unwrap_or(DEFAULT_PROFILE);
        let mut text = format!("profile {profile}");
        for (kind, name) in [("sensor", &self.sensor), ("robot", &self.robot)] {
            if let Some(name) = name {
                text += &format!(", {kind} {name}");
            }
        }
        for set in &self.set {
            text += &format!(", {set}");
        }
        text
    }

    /// The configuration in force for an input of this sensor.
    pub fn load(&self, input: SensorKind) -> anyhow::Result<Loaded> {
        Ok(Config::load(&Selection {
            profile: self.profile.clone(),
            sensor: self.sensor.clone(),
            sensor_from_input: sensor_name(input),
            robot: self.robot.clone(),
            set: self.set.clone(),
        })?)
    }
}

/// What the configuration calls a sensor; `None` where the input does not say.
fn sensor_name(kind: SensorKind) -> Option<&'static str> {
    match kind {
        SensorKind::Unknown => None,
        SensorKind::IsdrC => Some("isdr-c"),
        SensorKind::NavtechCts => Some("navtech-cts"),
    }
}

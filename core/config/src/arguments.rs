//! The options that choose a configuration, shared by every program that needs one.

use crate::builtin::{PROFILES, SENSORS};
use crate::name_or_file::NameOrFile;
use crate::{Config, DEFAULT_PROFILE, Error, Loaded, Selection};

/// Options that choose a configuration.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SelectionArguments {
    /// Environment: mixed (if not given), indoor, outdoor, oxford, or a file
    #[arg(long, value_name = "NAME|FILE", hide_possible_values = true,
        value_parser = NameOrFile::new(PROFILES.iter().map(|known| known.name)))]
    profile: Option<String>,
    /// Radar: isdr-c, navtech-cts, or a file; if not given, the one that a recording names, else
    /// isdr-c
    #[arg(long, value_name = "NAME|FILE", hide_possible_values = true,
        value_parser = NameOrFile::new(SENSORS.iter().map(|known| known.name)))]
    sensor: Option<String>,
    /// Where the sensors sit on the robot, and how the drivers reach them; if not given, as a
    /// recording says
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

    /// The same as arguments of another command.
    pub fn as_arguments(&self) -> Vec<String> {
        let mut arguments = Vec::new();
        for (option, value) in [
            ("--profile", &self.profile),
            ("--sensor", &self.sensor),
            ("--robot", &self.robot),
        ] {
            arguments.extend(value.iter().map(|value| format!("{option}={value}")));
        }
        arguments.extend(self.set.iter().map(|set| format!("--set={set}")));
        arguments
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

    /// The configuration in force; `sensor_from_input`: the radar that the input names.
    pub fn load(&self, sensor_from_input: Option<&'static str>) -> Result<Loaded, Error> {
        self.load_recorded(sensor_from_input, None)
    }

    /// The same for an input that was recorded with a configuration of its own: it holds unless
    /// the user names another.
    pub fn load_recorded(
        &self,
        sensor_from_input: Option<&'static str>,
        recorded: Option<String>,
    ) -> Result<Loaded, Error> {
        Config::load(&Selection {
            profile: self.profile.clone(),
            sensor: self.sensor.clone(),
            recorded,
            sensor_from_input,
            robot: self.robot.clone(),
            set: self.set.clone(),
        })
    }
}

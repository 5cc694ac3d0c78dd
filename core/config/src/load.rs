//! What is in force: defaults, then sensor, profile, robot and overrides, each over the one
//! before.

use crate::builtin::{Builtin, PROFILES, ROBOT, SENSORS};
use crate::layer::{
    Kind, Layer, Origins, ROBOT_FILE, SENSOR_FILE, apply_override, nearest, read_text,
};
use crate::{Config, Error, Location, RadarSource, Robot};
use std::io::ErrorKind;

/// The environment if the user names none.
pub const DEFAULT_PROFILE: &str = "mixed";
/// The radar if neither the user nor the input names one.
const DEFAULT_SENSOR: &str = "isdr-c";

/// Where the sensors sit: the input may have it too.
const ROBOT_SECTION: &str = "robot";

/// What the user and the input ask for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Environment: a built-in name or a file's path; `mixed` where there is none.
    pub profile: Option<String>,
    /// Radar: a built-in name or a file's path. It goes over a profile's own section `sensor`.
    pub sensor: Option<String>,
    /// Radar as the input names it; a profile's own section `sensor` goes over it.
    pub sensor_from_input: Option<&'static str>,
    /// The whole configuration of a recorded run, which holds where the user names neither profile
    /// nor sensor.
    pub recorded: Option<String>,
    /// Robot: a file's path; what lies in FILE.d beside it goes over it.
    pub robot: Option<String>,
    /// Overrides, `section.key=value`; the last one counts.
    pub set: Vec<String>,
}

/// A configuration, and where its values come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loaded {
    /// What is in force.
    pub config: Config,
    /// Where its values were set.
    pub origins: Origins,
    /// Keys of a log's own configuration that this build does not have: they are ignored.
    pub passed_over: Vec<String>,
}

impl Config {
    /// Reads what is asked for. The error has everything that is wrong in a file.
    pub fn load(selection: &Selection) -> Result<Loaded, Error> {
        let mut loaded = Loaded::default();
        let profile = selection.profile.as_deref().unwrap_or(DEFAULT_PROFILE);
        match (&selection.sensor, &selection.profile, &selection.recorded) {
            (None, None, Some(recorded)) => loaded.add_recorded(recorded)?,
            (None, ..) => {
                let from_input = selection.sensor_from_input;
                let sensor = from_input.map_or_else(|| selection.driven_sensor(), Ok)?;
                loaded.add("sensor", sensor, SENSORS)?;
                loaded.add("profile", profile, PROFILES)?;
            }
            (Some(sensor), ..) => {
                loaded.add("profile", profile, PROFILES)?;
                loaded.add("sensor", sensor, SENSORS)?;
            }
        }
        selection.finish(&mut loaded)?;
        loaded.config.check(&loaded.origins)?;
        Ok(loaded)
    }
}

impl Selection {
    /// Lays robot and overrides over what is there.
    fn finish(&self, loaded: &mut Loaded) -> Result<(), Error> {
        match &self.robot {
            None => loaded.add_text(ROBOT.source, ROBOT.text, Some(ROBOT_FILE))?,
            Some(path) => {
                loaded.add_text(path, &read_text(path)?, Some(ROBOT_FILE))?;
                for path in drop_ins(path)? {
                    loaded.add_text(&path, &read_text(&path)?, Some(ROBOT_FILE))?;
                }
            }
        }
        // All at once: connectivity_m may be set before range_resolution_m.
        loaded.with_connectivity(|loaded| {
            let mut overrides = self.set.iter();
            overrides.try_for_each(|text| apply_override(text, loaded))
        })
    }

    /// The radar that the robot's driver is for.
    fn driven_sensor(&self) -> Result<&'static str, Error> {
        let mut robot = Loaded::default();
        self.finish(&mut robot)?;
        Ok(match robot.config.radar.source {
            RadarSource::Navtech => "navtech-cts",
            RadarSource::BeamUdp => DEFAULT_SENSOR,
        })
    }
}

impl Loaded {
    /// Whether a key of this section was set; where none of [`crate::Robot`] was, the input's own
    /// mounting holds.
    pub fn is_set(&self, section: &str) -> bool {
        self.origins.keys().any(|(of, _)| *of == section)
    }

    /// Takes the mounting from the input unless one was set.
    pub fn mount(&mut self, robot: Robot) {
        if self.is_set(ROBOT_SECTION) {
            return;
        }
        self.config.robot = robot;
        for key in Robot::KEYS {
            let location = Location::whole("the input");
            self.origins.insert((ROBOT_SECTION, key.name), location);
        }
    }

    /// Lays a built-in or a file over what is there.
    fn add(
        &mut self,
        kind: &'static str,
        name: &str,
        builtins: &'static [Builtin],
    ) -> Result<(), Error> {
        let only = (kind == SENSOR_FILE.name).then_some(SENSOR_FILE);
        if let Some(builtin) = builtins.iter().find(|builtin| builtin.name == name) {
            return self.add_text(builtin.source, builtin.text, only);
        }
        let path_like = name.contains('/') || name.ends_with(".toml");
        if !path_like && !std::path::Path::new(name).exists() {
            let names: Vec<&str> = builtins.iter().map(|builtin| builtin.name).collect();
            return Err(Error::UnknownName {
                kind,
                name: name.to_owned(),
                nearest: nearest(name, names.iter().copied()),
                known: names.join(", "),
            });
        }
        self.add_text(name, &read_text(name)?, only)
    }

    /// Lays a log's own configuration over what is there. A log stays readable by builds that have
    /// other keys.
    fn add_recorded(&mut self, text: &str) -> Result<(), Error> {
        let (source, only) = ("the log", None);
        let problems = Layer { source, text, only }.apply(self).into_iter();
        let (unknown, wrong): (Vec<_>, Vec<_>) =
            problems.partition(|problem| matches!(problem, Error::Unknown { .. }));
        self.passed_over = unknown.iter().map(Error::to_string).collect();
        Error::all(wrong)
    }

    fn add_text(
        &mut self,
        source: &str,
        text: &str,
        only: Option<&'static Kind>,
    ) -> Result<(), Error> {
        let layer = Layer { source, text, only };
        Error::all(self.with_connectivity(|loaded| layer.apply(loaded)))
    }
}

/// The files that are laid over a file: `*.toml` in the folder FILE.d beside it, in the order of
/// their names. So a package's file can stay as it is, and what one robot has of its own is in a
/// separate file.
fn drop_ins(path: &str) -> Result<Vec<String>, Error> {
    let folder = format!("{path}.d");
    let entries = match std::fs::read_dir(&folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(Error::io(&folder))?,
    };
    let mut paths = Vec::new();
    for entry in entries {
        let name = entry.map_err(Error::io(&folder))?.file_name();
        let name = name.to_string_lossy();
        if name.ends_with(".toml") && !name.starts_with('.') {
            paths.push(format!("{folder}/{name}"));
        }
    }
    paths.sort();
    Ok(paths)
}

/// Checks a file of any kind for itself and together with the defaults.
pub fn check_file(path: &str) -> Result<(), Error> {
    let mut loaded = Loaded::default();
    loaded.add_text(path, &read_text(path)?, None)?;
    loaded.config.check(&loaded.origins)
}

#[cfg(test)]
mod tests;

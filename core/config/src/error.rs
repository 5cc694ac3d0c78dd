//! Why a configuration is refused.

use crate::{Origins, Place};

/// Why a configuration is refused (exit code 78).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system's word on a file.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// Its word.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{place}: {problem}")]
    Syntax {
        /// Where.
        place: Place,
        /// What the TOML reader says.
        problem: String,
    },
    /// Neither a built-in name nor a file.
    #[error(
        "there is neither a {kind} nor a file named {name:?}; did you mean {nearest:?}? ({known}, or a file's path)"
    )]
    UnknownName {
        /// `profile` or `sensor`.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// The nearest built-in.
        nearest: &'static str,
        /// All built-ins.
        known: String,
    },
    /// No such section.
    #[error("{place}: unknown section [{name}]; did you mean [{nearest}]?")]
    UnknownSection {
        /// Where.
        place: Place,
        /// What stands there.
        name: String,
        /// The nearest known section.
        nearest: &'static str,
    },
    /// No such key.
    #[error("{place}: unknown key {name:?}; did you mean {nearest:?}?")]
    UnknownKey {
        /// Where.
        place: Place,
        /// What stands there, as `section.key`.
        name: String,
        /// The nearest known key, as `section.key`.
        nearest: String,
    },
    /// A sensor file says how to drive, or the like.
    #[error(
        "{place}: section [{name}] does not belong into a {kind} file, which holds {sections} only; put it into a profile"
    )]
    Misplaced {
        /// Where.
        place: Place,
        /// The section.
        name: String,
        /// What the file is for: `sensor` or `robot`.
        kind: &'static str,
        /// The sections that it holds.
        sections: String,
    },
    /// The value has the wrong type or is outside its range.
    #[error("{place}: {name} is {found}, it must be {expected}")]
    Value {
        /// Where.
        place: Place,
        /// The key, as `section.key`.
        name: String,
        /// The value as it was written.
        found: String,
        /// What it must be.
        expected: String,
    },
    /// An override that is not `section.key=value`.
    #[error("--set {text:?} is not of the form section.key=value, such as ndt.cell_size_m=0.5")]
    MalformedOverride {
        /// What was given.
        text: String,
    },
    /// Two keys that are good each but not together.
    #[error("{less}, it must be below {more}")]
    Contradiction {
        /// The key that should be less, its value and where it comes from.
        less: String,
        /// The key that should be more, its value and where it comes from.
        more: String,
    },
    /// Keys that are good each but make too much together.
    #[error("{} together make {what}: {size:.0}, at most {most:.0} are possible", .keys.join(", "))]
    TooLarge {
        /// The keys, their values and where they come from.
        keys: Vec<String>,
        /// What they make.
        what: &'static str,
        /// How large that would be.
        size: f64,
        /// How large it may be.
        most: f64,
    },
    /// The sensor's description is of another sensor than the input's.
    #[error(
        "sensor {sensor:?} does not fit the input: sensor.{key} is {configured}, the input has {found}; \
         choose another --sensor or set sensor.{key}"
    )]
    SensorMismatch {
        /// Name of the sensor.
        sensor: String,
        /// The key that does not fit.
        key: &'static str,
        /// Its value.
        configured: f64,
        /// What the input says.
        found: f64,
    },
    /// More than one mistake, in the order of their places.
    #[error("{} mistakes:{}", .0.len(), .0.iter().map(|e| format!("\n  {e}")).collect::<String>())]
    Several(
        /// Each of them.
        Vec<Error>,
    ),
}

impl Error {
    /// A value that whoever uses it cannot work with, where it was written.
    pub fn value(
        origins: &Origins,
        (section, key): (&'static str, &'static str),
        found: &str,
        expected: String,
    ) -> Self {
        let place = origins.get(&(section, key)).cloned();
        Self::Value {
            place: place.unwrap_or_else(|| Place {
                source: "defaults".to_owned(),
                line: None,
            }),
            name: format!("{section}.{key}"),
            found: format!("{found:?}"),
            expected,
        }
    }

    /// Several mistakes as one error; none as none.
    pub fn all(mut mistakes: Vec<Self>) -> Result<(), Self> {
        match mistakes.pop() {
            None => Ok(()),
            Some(only) if mistakes.is_empty() => Err(only),
            Some(last) => {
                mistakes.push(last);
                Err(Self::Several(mistakes))
            }
        }
    }
}

//! Why a configuration is refused.

use crate::{Location, Origins};

/// Why a configuration is refused (exit code 78).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that the operating system does not read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// Its error.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{location}: {problem}")]
    Syntax {
        /// Where.
        location: Location,
        /// The error of the TOML reader.
        problem: String,
    },
    /// A name that is neither built in nor a file.
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
    /// No such section or key.
    #[error("{location}: unknown {name}; did you mean {nearest}?")]
    Unknown {
        /// Where.
        location: Location,
        /// What is written there, as `section [NAME]` or `key "section.key"`.
        name: String,
        /// The nearest known one, as `[NAME]` or `"section.key"`.
        nearest: String,
    },
    /// A section in a file that may not hold it, such as how to drive in a sensor file.
    #[error(
        "{location}: section [{name}] does not belong in a {kind} file, which holds {sections} only; put it into a profile"
    )]
    Misplaced {
        /// Where.
        location: Location,
        /// The section.
        name: String,
        /// What the file is for: `sensor` or `robot`.
        kind: &'static str,
        /// The sections that it holds.
        sections: String,
    },
    /// The value has the wrong type or is outside its range.
    #[error("{location}: {name} is {found}, it must be {expected}")]
    Value {
        /// Where.
        location: Location,
        /// The key, as `section.key`.
        name: String,
        /// The value as it was written.
        found: String,
        /// What it must be.
        expected: String,
    },
    /// An override that is not `section.key=value`.
    #[error("--set {0:?} is not of the form section.key=value, such as ndt.cell_size_m=0.5")]
    MalformedOverride(String),
    /// Two keys that are valid each but not together.
    #[error("{less}, it must be below {more}")]
    Contradiction {
        /// The key that should be less, its value and where it comes from.
        less: String,
        /// The key that should be more, its value and where it comes from.
        more: String,
    },
    /// Keys that are valid each but make too much together.
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
        /// What the input has.
        found: f64,
    },
    /// Polar images do not say how wide their range bins are.
    #[error("{bins} bins are not a CTS350-X's 3768: say sensor.range_resolution_m")]
    BinSizeUnknown {
        /// Bins of a beam.
        bins: usize,
    },
    /// More than one mistake, in the order of their locations.
    #[error("{} mistakes:{}", .0.len(), .0.iter().map(|e| format!("\n  {e}")).collect::<String>())]
    Several(
        /// Each of them.
        Vec<Error>,
    ),
}

impl Error {
    pub(crate) fn io(path: &str) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Io {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn syntax(location: Location, problem: impl Into<String>) -> Self {
        let problem = problem.into();
        Self::Syntax { location, problem }
    }

    /// A value that its user cannot work with, with the location where it was written.
    pub fn value(
        origins: &Origins,
        (section, key): (&'static str, &'static str),
        found: &str,
        expected: String,
    ) -> Self {
        let location = origins.get(&(section, key)).cloned();
        Self::Value {
            location: location.unwrap_or_else(|| Location::whole("defaults")),
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

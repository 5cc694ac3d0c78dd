//! One file or override, laid over what is in force.

use crate::section::Refusal;
use crate::{Config, Error, Loaded, Location};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// No configuration is longer; a device or a log that was given by mistake is.
const BYTES_MAX: u64 = 1 << 20;

/// Where each key that was set was set, by section and key. Keys that are not here have their
/// default.
pub type Origins = BTreeMap<(&'static str, &'static str), Location>;

/// A kind of file that holds some sections only.
#[derive(Debug)]
pub(crate) struct Kind {
    /// Its name for people.
    pub name: &'static str,
    /// The sections that belong in it.
    pub sections: &'static [&'static str],
}

/// What is particular to a radar.
pub(crate) const SENSOR_FILE: &Kind = &Kind {
    name: "sensor",
    sections: &["sensor"],
};

/// What is particular to a robot: where its sensors sit, and how they are reached.
pub(crate) const ROBOT_FILE: &Kind = &Kind {
    name: "robot",
    sections: &["robot", "radar", "imu", "record", "view", "link"],
};

/// A TOML text and where it comes from.
pub(crate) struct Layer<'a> {
    /// Path, or the name of a built-in file.
    pub source: &'a str,
    /// Its text.
    pub text: &'a str,
    /// What kind of file it is, if it may not hold every section.
    pub only: Option<&'static Kind>,
}

/// Reads a file's text.
pub(crate) fn read_text(path: &str) -> Result<String, Error> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    let read = file.take(BYTES_MAX + 1).read_to_end(&mut bytes);
    if read.map_err(Error::io(path))? as u64 > BYTES_MAX {
        let problem = "longer than 1 MiB, so not a configuration";
        return Err(Error::syntax(Location::whole(path), problem));
    }
    String::from_utf8(bytes).map_err(|error| {
        let location = Location::at(path, error.as_bytes(), error.utf8_error().valid_up_to());
        Error::syntax(location, "not UTF-8, so not a configuration")
    })
}

impl Layer<'_> {
    /// Lays the text over `config`. Returns everything that is wrong; what is right is set all the
    /// same.
    pub fn apply(&self, loaded: &mut Loaded) -> Vec<Error> {
        let (table, syntax) = DeTable::parse_recoverable(self.text);
        if !syntax.is_empty() {
            return syntax.iter().map(|error| self.syntax(error)).collect();
        }
        let mut problems = Vec::new();
        let mut sections: Vec<_> = table.get_ref().iter().collect();
        sections.sort_by_key(|(name, _)| name.span().start);
        for (name, keys) in sections {
            let location = self.location(name.span());
            let name = name.get_ref().as_ref();
            if let Some(problem) = self.misplaced(name, &location) {
                problems.push(problem);
                continue;
            }
            match keys.get_ref() {
                DeValue::Table(_) if !is_section(name) => {
                    problems.push(unknown_section(location, name));
                }
                DeValue::Table(keys) => {
                    let mut keys: Vec<_> = keys.iter().collect();
                    keys.sort_by_key(|(key, _)| key.span().start);
                    for (key, value) in keys {
                        let found = self.text.get(value.span()).unwrap_or_default();
                        let location = self.location(key.span());
                        let (key, value) = (key.get_ref(), value.get_ref());
                        problems.extend(loaded.set(name, key, value, found, location).err());
                    }
                }
                DeValue::Array(_) if is_section(name) => {
                    let problem = format!("[[{name}]] is a list; write [{name}]");
                    problems.push(Error::syntax(location, problem));
                }
                _ if is_section(name) => {
                    let problem = format!("{name} is a section; write [{name}] and its keys below");
                    problems.push(Error::syntax(location, problem));
                }
                // A key above the first section.
                _ => problems.push(unknown_key(location, "", name)),
            }
        }
        problems
    }

    fn location(&self, span: Range<usize>) -> Location {
        Location::at(self.source, self.text.as_bytes(), span.start)
    }

    fn syntax(&self, error: &toml::de::Error) -> Error {
        let location = error.span().map(|span| self.location(span));
        let location = location.unwrap_or_else(|| Location::whole(self.source));
        Error::syntax(location, error.message())
    }

    fn misplaced(&self, name: &str, location: &Location) -> Option<Error> {
        let only = self.only?;
        let misplaced = is_section(name) && !only.sections.contains(&name);
        misplaced.then(|| Error::Misplaced {
            location: location.clone(),
            name: name.to_owned(),
            kind: only.name,
            sections: format!("[{}]", only.sections.join("], [")),
        })
    }
}

/// Lays one `section.key=value` over what is loaded.
pub(crate) fn apply_override(text: &str, loaded: &mut Loaded) -> Result<(), Error> {
    let malformed = || Error::MalformedOverride(text.to_owned());
    let (name, found) = text.split_once('=').ok_or_else(malformed)?;
    let (section, key) = name.trim().split_once('.').ok_or_else(malformed)?;
    let found = found.trim();
    // A shell eats the quotes of a text: what is not TOML is a text.
    let parsed = DeValue::parse(found);
    let bare = DeValue::String(found.into());
    let value = parsed.as_ref().map_or(&bare, |value| value.get_ref());
    loaded.set(section, key, value, found, Location::whole("--set"))
}

impl Loaded {
    /// Sets one key; `found`: its value as it was written.
    fn set(
        &mut self,
        section: &str,
        key: &str,
        value: &DeValue<'_>,
        found: &str,
        location: Location,
    ) -> Result<(), Error> {
        match self.config.set(section, key, value) {
            Ok(()) => {
                // The names in the code live as long as the program.
                let known = Config::SECTIONS.iter().find(|s| s.name == section);
                let known =
                    known.and_then(|s| Some((s.name, s.keys.iter().find(|k| k.name == key)?)));
                let origin = known.map(|(section, key)| ((section, key.name), location));
                self.origins.extend(origin);
                Ok(())
            }
            Err(Refusal::NoSuchKey) if !is_section(section) => {
                Err(unknown_section(location, section))
            }
            Err(Refusal::NoSuchKey) => Err(unknown_key(location, section, key)),
            Err(Refusal::Value(expected)) => Err(Error::Value {
                location,
                name: format!("{section}.{key}"),
                found: found.to_owned(),
                expected,
            }),
        }
    }
}

fn is_section(name: &str) -> bool {
    Config::SECTIONS.iter().any(|section| section.name == name)
}

/// The known name that is nearest to the one that was written.
pub(crate) fn nearest(written: &str, known: impl Iterator<Item = &'static str>) -> &'static str {
    // People shorten names more often than they mistype them: a common beginning counts.
    let likeness = |name: &str| strsim::jaro_winkler(written, name);
    known
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        .unwrap_or_default()
}

fn unknown_section(location: Location, name: &str) -> Error {
    let nearest = nearest(name, Config::SECTIONS.iter().map(|s| s.name));
    Error::Unknown {
        location,
        name: format!("section [{name}]"),
        nearest: format!("[{nearest}]"),
    }
}

/// An unknown key with the nearest known one: of its own section, unless another's is nearer by
/// more than a slip.
fn unknown_key(location: Location, section: &str, key: &str) -> Error {
    const OTHER_SECTION: usize = 2;
    let distance = |(of, name): &(&'static str, &'static str)| {
        strsim::osa_distance(key, name) + if *of == section { 0 } else { OTHER_SECTION }
    };
    let nearest = Config::SECTIONS
        .iter()
        .flat_map(|of| of.keys.iter().map(|key| (of.name, key.name)))
        .min_by_key(distance)
        .map(|(of, name)| format!("{of}.{name}"))
        .unwrap_or_default();
    let name = match section {
        "" => key.to_owned(),
        _ => format!("{section}.{key}"),
    };
    Error::Unknown {
        location,
        name: format!("key {name:?}"),
        nearest: format!("{nearest:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_text_is_taken_or_refused(text in "[\\[\\]=.\"a-z_0-9\n# {},é-]{0,80}") {
            let layer = Layer { source: "t", text: &text, only: None };
            layer.apply(&mut Loaded::default());
        }

        #[test]
        fn what_is_taken_is_in_range(value in any::<f64>()) {
            let mut loaded = Loaded::default();
            for section in Config::SECTIONS {
                for key in section.keys {
                    let text = format!("{}.{}={value:?}", section.name, key.name);
                    let taken = apply_override(&text, &mut loaded).is_ok();
                    let shown = loaded.config.get(section.name, key.name).unwrap();
                    if let (true, Ok(number)) = (taken, shown.parse::<f64>()) {
                        prop_assert!(number == value && key.rule.allows(&[number]));
                    }
                }
            }
        }
    }
}

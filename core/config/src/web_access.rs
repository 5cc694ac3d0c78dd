//! Keys that list web origins or host names, separated by blanks.

use crate::value::Value;
use crate::{Host, WebOrigin};
use serde::{Serialize, Serializer};
use std::fmt::Display;
use toml::de::DeValue;

/// Origins of web pages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WebOrigins(pub Vec<WebOrigin>);

/// Names of a machine; none of them is an address.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HostNames(pub Vec<Host>);

impl Value for WebOrigins {
    const KIND: &'static str = "web origins, each SCHEME://HOST or SCHEME://HOST:PORT such as \
        https://viewer.example:8443, separated by blanks; null and * are everybody's";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        let words = value.as_str()?.split_whitespace();
        words.map(WebOrigin::parse).collect::<Option<_>>().map(Self)
    }

    fn write(&self) -> String {
        joined(&self.0).write()
    }
}

impl Value for HostNames {
    const KIND: &'static str = "host names such as robot.example.com, separated by blanks, without \
        ports; addresses need no entry";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        let words = value.as_str()?.split_whitespace();
        let names = words.map(|word| match Host::parse(word)? {
            Host::Address(_) => None,
            name => Some(name),
        });
        names.collect::<Option<_>>().map(Self)
    }

    fn write(&self) -> String {
        joined(&self.0).write()
    }
}

fn joined(words: &[impl Display]) -> String {
    let words: Vec<String> = words.iter().map(ToString::to_string).collect();
    words.join(" ")
}

impl Serialize for WebOrigins {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&joined(&self.0))
    }
}

impl Serialize for HostNames {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&joined(&self.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read<T: Value>(text: &str) -> Option<T> {
        T::read(&DeValue::String(text.into()))
    }

    #[test]
    fn lists_are_read_as_they_are_written() {
        let text = "https://viewer.example:8443 file:// http://[::1]:8080";
        let origins: WebOrigins = read(text).unwrap();
        assert_eq!(origins.write(), format!("{text:?}"));
        let names: HostNames = read(" Robot.example.com\tgate ").unwrap();
        assert_eq!(names.write(), "\"robot.example.com gate\"");
        assert_eq!(read("").map(|HostNames(names)| names.len()), Some(0));
    }

    #[test]
    fn what_everybody_could_say_is_refused() {
        for text in [
            "null",
            "*",
            "https://a.example *",
            "https://a.example/app",
            "a.example",
        ] {
            assert_eq!(read::<WebOrigins>(text), None, "{text}");
        }
        for text in [
            "*",
            "*.example",
            "a.example:80",
            "127.0.0.1",
            "[::1]",
            "http://a.example",
        ] {
            assert_eq!(read::<HostNames>(text), None, "{text}");
        }
    }
}

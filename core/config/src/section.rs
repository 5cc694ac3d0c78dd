//! One definition per key: type, default, range, unit and reason are written once and yield the
//! struct, its reader, its check and its help.

use crate::Rule;

/// One documented key.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name inside its section, with its unit.
    pub name: &'static str,
    /// What it means and why the default is what it is; one entry a line.
    pub doc: &'static [&'static str],
    /// Which numbers it takes.
    pub rule: Rule,
}

/// Why a key does not take a value.
#[derive(Debug, PartialEq)]
pub(crate) enum Refusal {
    /// There is no such key.
    NoSuchKey,
    /// The value is not of this type or range.
    Value(String),
}

/// Declares a section of the configuration: `name: type = default`, then `=> rule` where it is a
/// number.
macro_rules! section {
    ($(#[doc = $about:literal])+ pub struct $name:ident {
        $( $(#[doc = $doc:literal])+ pub $key:ident : $ty:ty = $default:expr $(=> $rule:expr)? ),+ $(,)?
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        pub struct $name { $( $(#[doc = $doc])+ pub $key : $ty ),+ }

        impl Default for $name {
            fn default() -> Self { Self { $( $key: $default ),+ } }
        }

        impl $name {
            /// What the section is about; one entry a line.
            pub const ABOUT: &'static [&'static str] = &[$($about),+];

            /// Every key of this section, in order.
            pub const KEYS: &'static [$crate::Key] = &[
                $( $crate::Key {
                    name: stringify!($key),
                    doc: &[$($doc),+],
                    rule: section!(@rule $($rule)?),
                } ),+
            ];

            /// Sets one key, if its type and range allow.
            pub(crate) fn set(
                &mut self,
                key: &str,
                value: &toml::de::DeValue<'_>,
            ) -> Result<(), $crate::section::Refusal> {
                use $crate::{section::Refusal, value::Value};
                match key {
                    $( stringify!($key) => {
                        let rule: $crate::Rule = section!(@rule $($rule)?);
                        let value = <$ty as Value>::read(value)
                            .ok_or_else(|| Refusal::Value(<$ty as Value>::KIND.to_owned()))?;
                        if !rule.allows(&value.numbers()) {
                            return Err(Refusal::Value(rule.to_string()));
                        }
                        self.$key = value;
                        Ok(())
                    } )+
                    _ => Err(Refusal::NoSuchKey),
                }
            }

            /// The TOML of one key's value.
            pub(crate) fn get(&self, key: &str) -> Option<String> {
                match key {
                    $( stringify!($key) => Some($crate::value::Value::write(&self.$key)), )+
                    _ => None,
                }
            }
        }
    };
    (@rule) => { $crate::Rule::NoNumber };
    (@rule $rule:expr) => { $rule };
}
pub(crate) use section;

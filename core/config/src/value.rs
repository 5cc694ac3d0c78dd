//! The types that a key can have: how each is read from TOML and written to it.

use toml::de::DeValue;

/// A type that a key can have.
pub(crate) trait Value: Sized {
    /// What it is called in messages.
    const KIND: &'static str;

    /// Reads it; `None` for any other type.
    fn read(value: &DeValue<'_>) -> Option<Self>;

    /// Its TOML.
    fn write(&self) -> String;

    /// The numbers in it, for a [`crate::Rule`].
    fn numbers(&self) -> Vec<f64> {
        Vec::new()
    }
}

impl Value for f64 {
    const KIND: &'static str = "a number";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        let number: f64 = match value {
            DeValue::Float(float) => float.as_str().parse().ok()?,
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok()?,
            _ => return None,
        };
        // -0.0 is 0.0: one value has one fingerprint, and no quotient by it changes its sign.
        Some(number + 0.0)
    }

    fn write(&self) -> String {
        format!("{self:?}")
    }

    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }
}

impl Value for u32 {
    const KIND: &'static str = "a whole number";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        let integer = value.as_integer()?;
        Self::from_str_radix(integer.as_str(), integer.radix()).ok()
    }

    fn write(&self) -> String {
        self.to_string()
    }

    fn numbers(&self) -> Vec<f64> {
        vec![f64::from(*self)]
    }
}

impl Value for bool {
    const KIND: &'static str = "true or false";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        value.as_bool()
    }

    fn write(&self) -> String {
        self.to_string()
    }
}

impl Value for String {
    const KIND: &'static str = "a text in quotes";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        value.as_str().map(str::to_owned)
    }

    fn write(&self) -> String {
        toml::Value::String(self.clone()).to_string()
    }
}

impl Value for Vec<f64> {
    const KIND: &'static str = "a list of numbers";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        let elements = value.as_array()?.iter();
        elements
            .map(|element| f64::read(element.as_ref()))
            .collect()
    }

    fn write(&self) -> String {
        let numbers: Vec<String> = self.iter().map(Value::write).collect();
        format!("[{}]", numbers.join(", "))
    }

    fn numbers(&self) -> Vec<f64> {
        self.clone()
    }
}

/// Declares a key's type that is one of some names.
macro_rules! choice {
    ($(#[doc = $about:literal])+ pub enum $name:ident ($kind:literal) {
        $( $(#[doc = $doc:literal])+ $variant:ident = $text:literal ),+ $(,)?
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
        pub enum $name { $( $(#[doc = $doc])+ #[serde(rename = $text)] $variant ),+ }

        impl $name {
            /// What the configuration calls it.
            pub fn name(self) -> &'static str {
                match self { $( Self::$variant => $text ),+ }
            }
        }

        impl $crate::value::Value for $name {
            const KIND: &'static str = $kind;

            fn read(value: &toml::de::DeValue<'_>) -> Option<Self> {
                match value.as_str()? {
                    $( $text => Some(Self::$variant), )+
                    _ => None,
                }
            }

            fn write(&self) -> String {
                format!("\"{}\"", self.name())
            }
        }
    };
}
pub(crate) use choice;

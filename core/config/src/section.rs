//! One definition per key: type, default, unit and reason stand in one place and yield the struct,
//! its parser and its help.

/// One documented key.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name inside its section, with its unit.
    pub name: &'static str,
    /// What it means and why the default is what it is; one entry a line.
    pub doc: &'static [&'static str],
}

/// Declares a section of the configuration.
macro_rules! section {
    ($(#[doc = $about:literal])+ pub struct $name:ident {
        $( $(#[doc = $doc:literal])+ pub $key:ident : $ty:ty = $default:expr ),+ $(,)?
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name { $( $(#[doc = $doc])+ pub $key : $ty ),+ }

        impl Default for $name {
            fn default() -> Self { Self { $( $key: $default ),+ } }
        }

        impl $name {
            /// Every key of this section, in order.
            pub const KEYS: &'static [$crate::Key] = &[
                $( $crate::Key { name: stringify!($key), doc: &[$($doc),+] } ),+
            ];
        }
    };
}
pub(crate) use section;

//! The profiles and sensors that come with the program.

/// A file that is part of the program.
pub(crate) struct Builtin {
    /// What the user calls it.
    pub name: &'static str,
    /// Its path in the repository.
    pub source: &'static str,
    /// Its text.
    pub text: &'static str,
}

macro_rules! builtin {
    ($( $name:literal = $path:literal ),+ $(,)?) => {
        &[ $( Builtin {
            name: $name,
            source: concat!("config/", $path),
            text: include_str!(concat!("../../../config/", $path)),
        } ),+ ]
    };
}

/// Environments.
pub(crate) const PROFILES: &[Builtin] = builtin! {
    "mixed" = "mixed.toml",
    "indoor" = "indoor.toml",
    "outdoor" = "outdoor.toml",
    "oxford" = "oxford.toml",
};

/// Radars.
pub(crate) const SENSORS: &[Builtin] = builtin! {
    "isdr-c" = "sensors/isdr-c.toml",
    "navtech-cts" = "sensors/navtech-cts.toml",
};

/// The robot, where the user names none.
pub(crate) const ROBOT: &Builtin = &Builtin {
    name: "robot",
    source: "config/robot.toml",
    text: include_str!("../../../config/robot.toml"),
};

//! What a driver says of its device.

/// How a driver stands to its device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Link {
    /// Nothing has been heard yet, and it is too early to wonder.
    #[default]
    Starting,
    /// Data come.
    Streaming,
    /// Data come, but a person should know this.
    Warning(String),
    /// No data come, for this reason.
    Trouble(String),
}

impl Link {
    /// What to tell people; empty where all is well.
    pub fn text(&self) -> &str {
        match self {
            Self::Starting | Self::Streaming => "",
            Self::Warning(text) | Self::Trouble(text) => text,
        }
    }

    /// Whether data come.
    pub fn streams(&self) -> bool {
        matches!(self, Self::Streaming | Self::Warning(_))
    }
}

/// A counter with its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// What is counted, such as `beams_lost`.
    pub name: &'static str,
    /// How often.
    pub value: u64,
    /// Whether each of them is a loss of data.
    pub loss: bool,
}

impl Count {
    /// Something that happened, no more.
    pub fn event(name: &'static str, value: u64) -> Self {
        Self {
            name,
            value,
            loss: false,
        }
    }

    /// Data that are missing.
    pub fn loss(name: &'static str, value: u64) -> Self {
        Self {
            name,
            value,
            loss: true,
        }
    }
}

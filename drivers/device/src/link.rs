//! The state of a driver's device.

/// How a driver stands to its device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Link {
    /// Nothing has come yet, and it is too early for a warning.
    #[default]
    Starting,
    /// Data come.
    Streaming,
    /// Data come, with this warning for people.
    Warning(String),
    /// No data come, for this reason.
    Down(String),
}

impl Link {
    /// Its text for people; empty where all is well.
    pub fn text(&self) -> &str {
        match self {
            Self::Starting | Self::Streaming => "",
            Self::Warning(text) | Self::Down(text) => text,
        }
    }

    /// Whether data come.
    pub fn streams(&self) -> bool {
        matches!(self, Self::Streaming | Self::Warning(_))
    }
}

/// How often data stopped coming.
#[derive(Clone, Copy, Debug, Default)]
pub struct Interruptions {
    streamed: bool,
    count: u64,
}

impl Interruptions {
    /// Takes the link as it is now.
    pub fn update(&mut self, link: &Link) {
        self.count += u64::from(self.streamed && !link.streams());
        self.streamed = link.streams();
    }

    /// Its counter.
    pub fn count(&self) -> Count {
        Count::event("interruptions", self.count)
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
        let loss = false;
        Self { name, value, loss }
    }

    /// Data that are missing.
    pub fn loss(name: &'static str, value: u64) -> Self {
        let loss = true;
        Self { name, value, loss }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interruption_counts_once_whatever_its_length() {
        let mut interruptions = Interruptions::default();
        let down = Link::Down("silent".to_owned());
        let warning = Link::Warning("slow".to_owned());
        let links = [
            &Link::Starting,
            &down,
            &Link::Streaming,
            &warning,
            &down,
            &down,
            &warning,
            &down,
        ];
        links
            .into_iter()
            .for_each(|link| interruptions.update(link));
        assert_eq!(interruptions.count().value, 2);
    }
}

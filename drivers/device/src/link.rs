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

/// How often data stopped coming.
#[derive(Clone, Copy, Debug, Default)]
pub struct Interruptions {
    streamed: bool,
    count: u64,
}

impl Interruptions {
    /// Looks how it is now.
    pub fn see(&mut self, link: &Link) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interruption_counts_once_however_long_it_lasts() {
        let mut interruptions = Interruptions::default();
        let trouble = Link::Trouble("silent".to_owned());
        let warning = Link::Warning("slow".to_owned());
        let links = [
            &Link::Starting,
            &trouble,
            &Link::Streaming,
            &warning,
            &trouble,
            &trouble,
            &warning,
            &trouble,
        ];
        links.into_iter().for_each(|link| interruptions.see(link));
        assert_eq!(interruptions.count().value, 2);
    }
}

//! Where a value was written.

use std::fmt;

/// Where a value was written: a file and its line, a built-in file, or the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file's path, or the option.
    pub source: String,
    /// Line in the file, from 1.
    pub line: Option<usize>,
}

impl Location {
    /// A whole file or an option.
    pub(crate) fn whole(source: &str) -> Self {
        Self {
            source: source.to_owned(),
            line: None,
        }
    }

    /// The line of a file in which this byte is.
    pub(crate) fn at(source: &str, text: &[u8], byte: usize) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        Self {
            source: source.to_owned(),
            line: Some(1 + before.iter().filter(|&&b| b == b'\n').count()),
        }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.source),
            None => write!(f, "{}", self.source),
        }
    }
}

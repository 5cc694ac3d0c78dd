//! What a check has found.

use serde::Serialize;
use std::fmt;

/// How much it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// As it should be.
    Ok,
    /// The pipeline works, but not as well as it could, or not for long.
    Warn,
    /// Something does not work.
    Bad,
}

/// A sentence, and the command that fixes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    pub grade: Grade,
    about: &'static str,
    text: String,
    fix: Option<String>,
}

impl Finding {
    /// All is well.
    pub fn ok(about: &'static str, text: impl Into<String>) -> Self {
        Self::new(Grade::Ok, about, text.into(), None)
    }

    /// Something should be fixed.
    pub fn warn(about: &'static str, text: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::new(Grade::Warn, about, text.into(), Some(fix.into()))
    }

    /// Something must be fixed.
    pub fn bad(about: &'static str, text: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::new(Grade::Bad, about, text.into(), Some(fix.into()))
    }

    fn new(grade: Grade, about: &'static str, text: String, fix: Option<String>) -> Self {
        Self {
            grade,
            about,
            text,
            fix,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let grade = match self.grade {
            Grade::Ok => "ok",
            Grade::Warn => "WARN",
            Grade::Bad => "BAD",
        };
        writeln!(f, "{grade:<4}  {:<10} {}", self.about, self.text)?;
        match &self.fix {
            Some(fix) => writeln!(f, "      fix it:    {fix}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fix_stands_below_what_is_wrong() {
        let text = Finding::bad("rights", "too wide", "chmod 700 x").to_string();
        assert_eq!(
            text,
            "BAD   rights     too wide\n      fix it:    chmod 700 x\n"
        );
        assert_eq!(
            Finding::ok("rights", "good").to_string(),
            "ok    rights     good\n"
        );
    }
}

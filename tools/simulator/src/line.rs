//! One line of a world's text, read word by word; errors name the line and the word.

use crate::{Material, WorldError};
use nalgebra::Vector2;
use std::str::SplitWhitespace;

/// Coordinates beyond are typing errors: a radar sees 16 m.
pub(crate) const COORDINATE_MAX_M: f64 = 500.0;

/// A line that is being read.
pub(crate) struct Line<'a> {
    /// Counted from 1.
    pub number: usize,
    /// Its first word.
    pub statement: &'a str,
    /// The words that are left.
    pub words: SplitWhitespace<'a>,
}

impl<'a> Line<'a> {
    pub fn word(&mut self, expected: &str) -> Result<&'a str, WorldError> {
        self.words.next().ok_or_else(|| self.short(expected))
    }

    pub fn keyword(&mut self, keyword: &str) -> Result<(), WorldError> {
        match self.word(keyword)? {
            word if word == keyword => Ok(()),
            word => Err(self.wrong(word, keyword)),
        }
    }

    pub fn material(&mut self) -> Result<Material, WorldError> {
        let names = Material::ALL.map(Material::name).join(", ");
        let expected = format!("one of {names}");
        let word = self.word(&expected)?;
        let material = Material::ALL.into_iter().find(|one| one.name() == word);
        material.ok_or_else(|| self.wrong(word, &expected))
    }

    pub fn number(&mut self, what: &str, min: f64, max: f64) -> Result<f64, WorldError> {
        let expected = format!("{what}, {min} to {max}");
        let word = self.word(&expected)?;
        self.as_number(word, word, &expected, min, max)
    }

    fn as_number(
        &self,
        text: &str,
        word: &str,
        expected: &str,
        min: f64,
        max: f64,
    ) -> Result<f64, WorldError> {
        let number = text.parse().ok();
        let number = number.filter(|value| (min..=max).contains(value));
        number.ok_or_else(|| self.wrong(word, expected))
    }

    pub fn point(&mut self) -> Result<Vector2<f64>, WorldError> {
        let expected = match self.statement {
            "slope" => "grades X,Y",
            _ => "a point X,Y in m",
        };
        let word = self.word(expected)?;
        self.as_point(word)
    }

    pub fn as_point(&self, word: &str) -> Result<Vector2<f64>, WorldError> {
        let max = COORDINATE_MAX_M;
        self.pair(word, ',', &format!("X,Y, each {} to {max}", -max), -max)
    }

    pub fn size(&mut self) -> Result<Vector2<f64>, WorldError> {
        let expected = format!("a size WIDTHxDEPTH in m, each 0.01 to {COORDINATE_MAX_M}");
        let word = self.word(&expected)?;
        self.pair(word, 'x', &expected, 0.01)
    }

    fn pair(
        &self,
        word: &str,
        separator: char,
        expected: &str,
        min: f64,
    ) -> Result<Vector2<f64>, WorldError> {
        let parts = word.split_once(separator);
        let (x, y) = parts.ok_or_else(|| self.wrong(word, expected))?;
        let value = |text| self.as_number(text, word, expected, min, COORDINATE_MAX_M);
        Ok(Vector2::new(value(x)?, value(y)?))
    }

    pub fn end(&mut self, next: Option<&str>) -> Result<(), WorldError> {
        match next.or_else(|| self.words.next()) {
            None => Ok(()),
            Some(word) => Err(self.wrong(word, "the line's end")),
        }
    }

    pub fn wrong(&self, word: &str, expected: &str) -> WorldError {
        WorldError::Word {
            line: self.number,
            word: word.to_owned(),
            expected: expected.to_owned(),
        }
    }

    pub fn short(&self, expected: &str) -> WorldError {
        WorldError::Short {
            line: self.number,
            statement: self.statement.to_owned(),
            expected: expected.to_owned(),
        }
    }
}

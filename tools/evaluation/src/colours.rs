//! The colours of all pictures.

use plotters::style::RGBColor;

pub(crate) const INK: RGBColor = RGBColor(38, 43, 51);
pub(crate) const GRID: RGBColor = RGBColor(231, 234, 238);
pub(crate) const MAP: RGBColor = RGBColor(160, 170, 184);
pub(crate) const TRUTH: RGBColor = RGBColor(24, 24, 27);
pub(crate) const ESTIMATE: RGBColor = RGBColor(224, 72, 38);
pub(crate) const LOOP: RGBColor = RGBColor(31, 111, 178);
pub(crate) const LIVE: RGBColor = RGBColor(226, 158, 60);
pub(crate) const APART: RGBColor = RGBColor(116, 78, 190);

/// What a line or a band of a chart is drawn in: by what it means, so that all charts speak alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// The line that the panel is about.
    First,
    /// The one beside it.
    Second,
    /// A third one.
    Third,
    /// What others are compared with.
    Faint,
    /// Less than it should be.
    Warning,
    /// Lost or missing.
    Bad,
}

impl Colour {
    pub(crate) fn rgb(self) -> RGBColor {
        match self {
            Self::First => ESTIMATE,
            Self::Second => LOOP,
            Self::Third => RGBColor(66, 140, 82),
            Self::Faint => MAP,
            Self::Warning => RGBColor(240, 180, 40),
            Self::Bad => RGBColor(208, 24, 40),
        }
    }
}

//! An axis whose grid lines stand where the view wants them, the same for x and y.

use crate::view::View;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use std::ops::Range;

/// An axis in metres.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    range_m: Range<f64>,
    lines_m: Vec<f64>,
}

impl Axis {
    /// The axis of one of the view's ranges.
    pub fn new(range_m: &Range<f64>, view: &View) -> Self {
        Self {
            range_m: range_m.clone(),
            lines_m: view.lines(range_m),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value_m: &f64, (first, last): (i32, i32)) -> i32 {
        let share = (value_m - self.range_m.start) / (self.range_m.end - self.range_m.start);
        let pixel = f64::from(first) + share * (f64::from(last) - f64::from(first));
        // Far outside is far enough at a million pixels; the drawing area clips it.
        pixel.clamp(-1e6, 1e6).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.lines_m.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range_m.clone()
    }
}

//! One panel of a chart: what is in it, and which values its axis shows.

use crate::Colour;
use std::ops::Range;

/// Room above and below what is drawn, as a share of the drawn height.
const MARGIN: f64 = 0.06;
/// Values beyond this many times the 99th percentile do not stretch the axis.
const OUTLIER: f64 = 3.0;

/// A line over time; points (s, value), in order. It ends where nothing came for long and at what
/// is not finite.
#[derive(Clone, Debug)]
pub struct Line {
    /// For the legend.
    pub name: &'static str,
    /// How it is drawn.
    pub colour: Colour,
    /// From left to right.
    pub points: Vec<[f64; 2]>,
}

/// A span of time that is marked.
#[derive(Clone, Debug)]
pub struct Band {
    /// For the legend; those of one name stand there once.
    pub name: &'static str,
    /// How it is drawn.
    pub colour: Colour,
    /// From when to when, s; at least two pixels are drawn.
    pub span_s: [f64; 2],
}

/// Lines on one axis.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// What is shown, with its unit.
    pub label: String,
    /// Drawn in this order.
    pub lines: Vec<Line>,
    /// Drawn below the lines.
    pub bands: Vec<Band>,
    /// Values that the axis shows at least.
    pub at_least: Option<[f64; 2]>,
    /// Single values far above all others are drawn at the edge, and the label has their number
    /// and height.
    pub cut_outliers: bool,
    /// Half as high as others.
    pub is_low: bool,
}

/// Which values a panel shows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    pub range: Range<f64>,
    /// How many values are above, and the greatest of them.
    pub above: Option<(usize, f64)>,
}

impl Panel {
    /// The range of the axis; `None` where there is nothing to draw.
    pub(crate) fn shown(&self) -> Option<Shown> {
        let mut values: Vec<f64> = self
            .lines
            .iter()
            .flat_map(|line| &line.points)
            .filter(|point| point[0].is_finite() && point[1].is_finite())
            .map(|point| point[1])
            .collect();
        values.sort_by(f64::total_cmp);
        let (mut least, mut most) = (*values.first()?, *values.last()?);
        let mut above = None;
        if self.cut_outliers {
            let usual = values.get(values.len() * 99 / 100).copied();
            let limit = OUTLIER * usual.unwrap_or(most);
            let count = values.iter().filter(|value| **value > limit).count();
            if count > 0 && limit > 0.0 {
                above = Some((count, most));
                most = limit;
            }
        }
        let [low, high] = self.at_least.unwrap_or([least, most]);
        (least, most) = (least.min(low), most.max(high));
        // A constant still has an axis.
        let span = (most - least)
            .max(least.abs().max(most.abs()) * 1e-3)
            .max(1e-6);
        // Zero stays at the edge where it is one.
        let below = if least == 0.0 { 0.0 } else { MARGIN * span };
        Some(Shown {
            range: least - below..most.max(least + span) + MARGIN * span,
            above,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(values: &[f64]) -> Panel {
        let points = (0..).zip(values).map(|(n, y)| [f64::from(n), *y]);
        Panel {
            lines: vec![Line {
                name: "",
                colour: Colour::First,
                points: points.collect(),
            }],
            ..Panel::default()
        }
    }

    #[test]
    fn the_axis_holds_what_is_drawn_and_what_it_must() {
        assert_eq!(panel(&[]).shown(), None);
        assert_eq!(panel(&[f64::NAN]).shown(), None);
        let range = panel(&[-1.0, 4.0]).shown().unwrap().range;
        assert!(range.start < -1.0 && range.end > 4.0 && range.end < 5.0);
        let range = panel(&[7.0, 7.0]).shown().unwrap().range;
        assert!(range.start < 7.0 && range.end > 7.0);
        let mut from_zero = panel(&[7.0, 8.0]);
        from_zero.at_least = Some([0.0, 0.0]);
        assert_eq!(from_zero.shown().unwrap().range.start, 0.0);
    }

    #[test]
    fn one_peak_does_not_flatten_all_others() {
        let mut values = vec![1.0; 1000];
        values[500] = 800.0;
        let mut peak = panel(&values);
        assert!(peak.shown().unwrap().range.end > 800.0);
        peak.cut_outliers = true;
        let shown = peak.shown().unwrap();
        assert_eq!(shown.above, Some((1, 800.0)));
        assert!(shown.range.end < 4.0);
        // Many are no outliers.
        (0..50).for_each(|n| peak.lines[0].points[n][1] = 700.0);
        assert!(peak.shown().unwrap().range.end > 700.0);
    }
}

//! Figures over time: panels one below the other, on one axis of time.

use crate::colours::{GRID, INK};
use crate::panel::{Band, Line, Panel, Shown};
use crate::view::{EDGE, LEFT, RIGHT, WIDTH};
use crate::{Colour, Error, thin, ticks};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// What is drawn. The same input gives the same bytes.
#[derive(Clone, Copy, Debug)]
pub struct Chart<'a> {
    /// Heading of the picture.
    pub title: &'a str,
    /// What the axis of time counts from, for its label.
    pub since: &'a str,
    /// The end of the axis, that begins at 0, s.
    pub span_s: f64,
    /// From above to below.
    pub panels: &'a [Panel],
}

/// Room above the first panel, above each for its label, and below the last for the numbers,
/// pixels.
const HEADING: i32 = 50;
const LABEL: i32 = 40;
const FOOT: i32 = 70;
/// Height of a panel, and of a low one, pixels.
const HEIGHT: i32 = 220;
const LOW: i32 = 84;
/// Grid lines along time, and across a panel and a low one, at most.
const LINES_TIME: f64 = 12.0;
const LINES: f64 = 5.0;
const LINES_LOW: f64 = 3.0;
/// Sizes of writing, pixels.
const LARGE: i32 = 26;
const SMALL: i32 = 19;
/// Width of a letter as a share of its size, on the average: only the room between entries depends
/// on it.
const LETTER: f64 = 0.52;

pub(crate) type Root<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Draws an SVG.
pub fn plot_chart(chart: &Chart<'_>) -> Result<String, Error> {
    let heights = chart.panels.iter().map(|panel| LABEL + height(panel));
    let all = HEADING + heights.sum::<i32>() + FOOT;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, all.unsigned_abs()));
        draw(chart, &root.into_drawing_area()).map_err(|error| Error::Plot(error.to_string()))?;
    }
    Ok(svg)
}

fn height(panel: &Panel) -> i32 {
    if panel.is_low { LOW } else { HEIGHT }
}

/// Where a panel lies in the picture, and what it shows.
struct Frame {
    x: Range<i32>,
    y: Range<i32>,
    span_s: f64,
    values: Range<f64>,
}

impl Frame {
    /// Pixels to the right of the panel's left edge.
    fn across(&self, time_s: f64) -> f64 {
        time_s / self.span_s * f64::from(self.x.end - self.x.start)
    }

    fn column(&self, across: f64) -> i32 {
        let right = f64::from(self.x.end - self.x.start);
        self.x.start + across.clamp(0.0, right).round() as i32
    }

    /// What lies beyond the axis is drawn at its edge.
    fn row(&self, value: f64) -> i32 {
        let share = (value - self.values.start) / (self.values.end - self.values.start);
        let height = f64::from(self.y.end - self.y.start);
        self.y.end - (share.clamp(0.0, 1.0) * height).round() as i32
    }
}

fn draw(chart: &Chart<'_>, root: &Root<'_>) -> Drawn {
    root.fill(&WHITE)?;
    let left = (EDGE + LEFT) as i32;
    let right = (WIDTH - RIGHT) as i32;
    let at = (left, 14);
    write(root, chart.title, at, LARGE, (HPos::Left, VPos::Top))?;
    let mut top = HEADING;
    for panel in chart.panels {
        top += LABEL;
        let bottom = top + height(panel);
        let shown = panel.shown();
        let frame = Frame {
            x: left..right,
            y: top..bottom,
            // A log of one message has no span.
            span_s: chart.span_s.max(1e-3),
            values: shown.as_ref().map_or(0.0..1.0, |shown| shown.range.clone()),
        };
        label(root, panel, shown.as_ref(), &frame)?;
        bands(root, panel, &frame)?;
        grid(root, &frame, shown.is_some(), panel.is_low)?;
        for line in &panel.lines {
            curve(root, line, &frame)?;
        }
        if shown.is_none() {
            let middle = ((left + right) / 2, (top + bottom) / 2);
            write(root, "no data", middle, SMALL, (HPos::Center, VPos::Center))?;
        }
        top = bottom;
    }
    time_axis(root, chart, left..right, top)?;
    root.present()
}

fn write(
    root: &Root<'_>,
    text: &str,
    at: (i32, i32),
    size: i32,
    (h_pos, v_pos): (HPos, VPos),
) -> Drawn {
    let style = ("sans-serif", size).into_font().color(&INK);
    let style = style.pos(Pos::new(h_pos, v_pos));
    root.draw(&Text::new(text.to_owned(), at, style))
}

/// About how wide a text is, pixels.
fn width(text: &str) -> i32 {
    (text.chars().count() as f64 * LETTER * f64::from(SMALL)) as i32
}

/// What the panel shows, and a sample of everything that is in it.
fn label(root: &Root<'_>, panel: &Panel, shown: Option<&Shown>, frame: &Frame) -> Drawn {
    let middle = frame.y.start - 15;
    let mut text = panel.label.clone();
    if let Some((count, most)) = shown.and_then(|shown| shown.above) {
        text += &format!(" (above the axis: {count}, up to {most:.0})");
    }
    let begin = (frame.x.start, middle);
    write(root, &text, begin, SMALL, (HPos::Left, VPos::Center))?;
    let mut entries: Vec<(&str, ShapeStyle)> = Vec::new();
    let is_named = |line: &&Line| !(line.name.is_empty() || line.points.is_empty());
    for line in panel.lines.iter().filter(is_named) {
        let style = line.colour.rgb().stroke_width(stroke(line).max(3));
        entries.push((line.name, style));
    }
    for Band { name, colour, .. } in &panel.bands {
        if !entries.iter().any(|(known, _)| known == name) {
            entries.push((name, colour.rgb().mix(0.5).stroke_width(14)));
        }
    }
    let mut end = frame.x.end;
    for (name, style) in entries.into_iter().rev() {
        let text = end - width(name);
        let at = (text, middle);
        write(root, name, at, SMALL, (HPos::Left, VPos::Center))?;
        let sample = vec![(text - 38, middle), (text - 10, middle)];
        root.draw(&PathElement::new(sample, style))?;
        end = text - 38 - 20;
    }
    Ok(())
}

fn bands(root: &Root<'_>, panel: &Panel, frame: &Frame) -> Drawn {
    for band in &panel.bands {
        let [from, to] = band.span_s.map(|time_s| frame.across(time_s));
        let (from, to) = (frame.column(from), frame.column(to));
        let corners = [(from, frame.y.start), (to.max(from + 2), frame.y.end)];
        let style = band.colour.rgb().mix(0.45).filled();
        root.draw(&Rectangle::new(corners, style))?;
    }
    Ok(())
}

fn grid(root: &Root<'_>, frame: &Frame, has_values: bool, is_low: bool) -> Drawn {
    let rule = |from, to, style| root.draw(&PathElement::new(vec![from, to], style));
    let light = GRID.stroke_width(1);
    let (step_s, _) = ticks::step(frame.span_s, LINES_TIME);
    for time_s in ticks::within(&(0.0..frame.span_s), step_s) {
        let x = frame.column(frame.across(time_s));
        rule((x, frame.y.start), (x, frame.y.end), light)?;
    }
    if has_values {
        let lines = if is_low { LINES_LOW } else { LINES };
        let (step, decimals) = ticks::step(frame.values.end - frame.values.start, lines);
        for value in ticks::within(&frame.values, step) {
            let y = frame.row(value);
            rule((frame.x.start, y), (frame.x.end, y), light)?;
            // No minus before a zero.
            let text = format!("{:.decimals$}", value + 0.0);
            let at = (frame.x.start - 8, y);
            write(root, &text, at, SMALL, (HPos::Right, VPos::Center))?;
        }
    }
    let corners = [(frame.x.start, frame.y.start), (frame.x.end, frame.y.end)];
    root.draw(&Rectangle::new(corners, INK.mix(0.5)))
}

/// How thick a line is, pixels: what others are compared with shows on both sides of them.
fn stroke(line: &Line) -> u32 {
    match line.colour {
        Colour::Faint => 6,
        _ => 2,
    }
}

fn curve(root: &Root<'_>, line: &Line, frame: &Frame) -> Drawn {
    let across = |[time_s, value]: &[f64; 2]| [frame.across(*time_s), *value];
    let points: Vec<[f64; 2]> = line.points.iter().map(across).collect();
    let colour = line.colour.rgb();
    for run in thin::runs(&points) {
        let pixel = |[x, value]: &[f64; 2]| (frame.column(*x), frame.row(*value));
        let pixels: Vec<(i32, i32)> = run.iter().map(pixel).collect();
        match pixels.as_slice() {
            // What stands alone would be no line.
            [alone] => root.draw(&Circle::new(*alone, 2, colour.filled()))?,
            _ => root.draw(&PathElement::new(pixels, colour.stroke_width(stroke(line))))?,
        }
    }
    Ok(())
}

fn time_axis(root: &Root<'_>, chart: &Chart<'_>, x: Range<i32>, bottom: i32) -> Drawn {
    let span_s = chart.span_s.max(1e-3);
    let (step_s, decimals) = ticks::step(span_s, LINES_TIME);
    let frame = Frame {
        x: x.clone(),
        y: bottom..bottom,
        span_s,
        values: 0.0..1.0,
    };
    for time_s in ticks::within(&(0.0..span_s), step_s) {
        let at = (frame.column(frame.across(time_s)), bottom + 8);
        let text = format!("{time_s:.decimals$}");
        write(root, &text, at, SMALL, (HPos::Center, VPos::Top))?;
    }
    let at = (i32::midpoint(x.start, x.end), bottom + 38);
    let text = format!("time since {}, s", chart.since);
    write(root, &text, at, SMALL, (HPos::Center, VPos::Top))
}

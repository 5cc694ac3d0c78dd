//! The picture: estimate, truth and map seen from above, in metres.

use crate::Error;
use crate::axis::Axis;
use crate::chart::{Drawn, Root};
use crate::colours::{APART, ESTIMATE, GRID, INK, LIVE, LOOP, MAP, TRUTH};
use crate::view::{BOTTOM, EDGE, LEFT, RIGHT, TOP, View, WIDTH, is_drawable};
use plotters::prelude::*;
use std::collections::BTreeSet;

/// What is drawn; everything but what is apart in one frame, m. What is not finite is left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plot<'a> {
    /// Heading of the picture.
    pub title: &'a str,
    /// The estimate, one line for each frame.
    pub estimate: &'a [Vec<[f64; 2]>],
    /// The estimate as it was known at the time, likewise; empty where only the last one is shown.
    pub live: &'a [Vec<[f64; 2]>],
    /// The truth, already laid onto the estimate; empty where there is none.
    pub truth: &'a [[f64; 2]],
    /// Points of the map, drawn lightly below.
    pub map: &'a [[f64; 2]],
    /// Loops that were closed, from pose to pose.
    pub loops: &'a [[[f64; 2]; 2]],
    /// The lines of each component that no loop joins to the rest. Where it lies is not known: it
    /// is drawn to the right of everything else.
    pub apart: &'a [Vec<Vec<[f64; 2]>>],
}

/// Edge of a map pixel. Points on one pixel are drawn once and neighbours as one, so that the file
/// stays small.
const MAP_PIXEL: i32 = 2;

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;

/// Draws an SVG. The same input gives the same bytes.
pub fn plot_trajectories(plot: &Plot<'_>) -> Result<String, Error> {
    let view = View::from_plot(plot);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, view.height)).into_drawing_area();
        draw(plot, &view, &root).map_err(|error| Error::Plot(error.to_string()))?;
    }
    Ok(svg)
}

fn draw(plot: &Plot<'_>, view: &View, root: &Root<'_>) -> Drawn {
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(root)
        .margin_top(TOP)
        .margin_right(RIGHT)
        .margin_bottom(EDGE)
        .margin_left(EDGE)
        .x_label_area_size(BOTTOM)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(Axis::new(&view.x_m, view), Axis::new(&view.y_m, view))?;
    let number = |value: &f64| format!("{value:.*}", view.decimals);
    let text = ("sans-serif", 19).into_font().color(&INK);
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.stroke_width(1))
        .axis_style(INK.mix(0.5))
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .x_desc("x, m")
        .y_desc("y, m")
        .label_style(text.clone())
        .axis_desc_style(text)
        .draw()?;
    map(plot.map, root, &chart)?;
    for ends in plot.loops {
        line(&mut chart, ends, LOOP.mix(0.6).stroke_width(2))?;
    }
    line(&mut chart, plot.truth, TRUTH.stroke_width(5))?;
    for frame in plot.live {
        line(&mut chart, frame, LIVE.stroke_width(2))?;
    }
    for frame in plot.estimate {
        line(&mut chart, frame, ESTIMATE.stroke_width(2))?;
    }
    for part in &view.apart {
        line(&mut chart, part, APART.stroke_width(2))?;
    }
    for frame in plot.estimate {
        let mut points = frame.iter().filter(|point| is_drawable(point));
        if let Some(first) = points.next() {
            let last = points.next_back().unwrap_or(first);
            let mark = |at: &[f64; 2], style| Circle::new((at[0], at[1]), 7, style);
            chart.draw_series([
                mark(first, WHITE.filled()),
                mark(first, ESTIMATE.stroke_width(3)),
                mark(last, ESTIMATE.filled()),
            ])?;
        }
    }
    legend(plot, root)?;
    root.present()
}

fn line(chart: &mut Chart<'_, '_>, points: &[[f64; 2]], style: ShapeStyle) -> Drawn {
    let points = points.iter().filter(|point| is_drawable(point));
    let points = points.map(|point| (point[0], point[1]));
    chart.draw_series(LineSeries::new(points, style))?;
    Ok(())
}

/// The map's points as pixels, runs of neighbours as one rectangle.
fn map(points: &[[f64; 2]], root: &Root<'_>, chart: &Chart<'_, '_>) -> Drawn {
    let area = chart.plotting_area();
    let (columns, rows) = area.get_pixel_range();
    let points = points.iter().filter(|point| is_drawable(point));
    let pixels: BTreeSet<(i32, i32)> = points
        .map(|point| area.map_coordinate(&(point[0], point[1])))
        .filter(|(x, y)| columns.contains(x) && rows.contains(y))
        .map(|(x, y)| (y.div_euclid(MAP_PIXEL), x.div_euclid(MAP_PIXEL)))
        .collect();
    let pixels: Vec<(i32, i32)> = pixels.into_iter().collect();
    for run in pixels.chunk_by(|a, b| a.0 == b.0 && a.1 + 1 == b.1) {
        if let (Some(&(row, first)), Some(&(_, last))) = (run.first(), run.last()) {
            let corners = [
                (first * MAP_PIXEL, row * MAP_PIXEL),
                ((last + 1) * MAP_PIXEL, (row + 1) * MAP_PIXEL),
            ];
            root.draw(&Rectangle::new(corners, MAP.filled()))?;
        }
    }
    Ok(())
}

/// Heading, and below it a sample of each line that there is.
fn legend(plot: &Plot<'_>, root: &Root<'_>) -> Drawn {
    /// Top of the second row, and the room that one entry takes.
    const ROW: i32 = 58;
    const ENTRY: i32 = 150;
    let left = (EDGE + LEFT) as i32;
    let heading = ("sans-serif", 26).into_font().color(&INK);
    root.draw(&Text::new(plot.title.to_owned(), (left, 14), heading))?;
    let entries = [
        ("estimate", ESTIMATE, 3, plot.estimate.is_empty()),
        ("live", LIVE, 3, plot.live.is_empty()),
        ("truth", TRUTH, 5, plot.truth.is_empty()),
        ("loops", LOOP, 2, plot.loops.is_empty()),
        ("returns", MAP, 7, plot.map.is_empty()),
        ("not joined", APART, 3, plot.apart.is_empty()),
    ];
    let label = ("sans-serif", 19).into_font().color(&INK);
    let mut x = left;
    for (name, colour, width, _) in entries.into_iter().filter(|(.., is_empty)| !is_empty) {
        let style = colour.stroke_width(width);
        root.draw(&PathElement::new(vec![(x, ROW), (x + 34, ROW)], style))?;
        root.draw(&Text::new(name, (x + 44, ROW - 11), label.clone()))?;
        x += ENTRY;
    }
    if plot.estimate.iter().any(|frame| !frame.is_empty()) {
        for (name, fill) in [("start", WHITE), ("end", ESTIMATE)] {
            root.draw(&Circle::new((x + 8, ROW), 7, fill.filled()))?;
            root.draw(&Circle::new((x + 8, ROW), 7, ESTIMATE.stroke_width(3)))?;
            root.draw(&Text::new(name, (x + 26, ROW - 11), label.clone()))?;
            x += ENTRY - 50;
        }
    }
    Ok(())
}

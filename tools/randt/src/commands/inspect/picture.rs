//! Three scans beside each other, in the radar's frame: forward is up.

use super::survey::Survey;
use std::fmt::Write;

/// Edge of a scan's square, and what is around it, in pixels.
const EDGE: f64 = 380.0;
const MARGIN: f64 = 20.0;

/// The picture as SVG.
pub fn draw(survey: &Survey, is_size_assumed: bool) -> String {
    let count = survey.sketches.len() as f64;
    let (width, height) = (count * (EDGE + MARGIN) + MARGIN, EDGE + 3.0 * MARGIN);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    // Nine of ten returns and some room.
    let reach_m = survey.reach_m.unwrap_or(10.0).max(1.0) * 1.2;
    let scale = 0.5 * EDGE / reach_m;
    let ring_m = ring(reach_m);
    for (index, sketch) in survey.sketches.iter().enumerate() {
        let left = MARGIN + index as f64 * (EDGE + MARGIN);
        let (middle_x, middle_y) = (left + 0.5 * EDGE, 2.0 * MARGIN + 0.5 * EDGE);
        // Writing to a String cannot fail.
        let _ = writeln!(
            svg,
            "<text x=\"{left}\" y=\"{:.0}\">scan after {:.1} s, rings of {ring_m} m{}</text>",
            1.5 * MARGIN,
            sketch.after_s,
            if is_size_assumed {
                " if bins are 0.05 m wide"
            } else {
                ""
            }
        );
        let mut radius_m = ring_m;
        while radius_m < reach_m {
            let _ = writeln!(
                svg,
                "<circle cx=\"{middle_x}\" cy=\"{middle_y}\" r=\"{:.1}\" fill=\"none\" stroke=\"#ccc\"/>",
                radius_m * scale
            );
            radius_m += ring_m;
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{middle_x} {middle_y}v-18m-4 6l4 -6l4 6\" fill=\"none\" stroke=\"#c33\" stroke-width=\"2\"/>"
        );
        svg += "<path stroke=\"#235\" stroke-width=\"1.5\" stroke-linecap=\"round\" d=\"";
        for [x_m, y_m] in &sketch.points_m {
            let (x_m, y_m) = (f64::from(*x_m), f64::from(*y_m));
            if x_m.abs().max(y_m.abs()) <= reach_m {
                let (x, y) = (middle_x - y_m * scale, middle_y - x_m * scale);
                let _ = write!(svg, "M{x:.1} {y:.1}h0");
            }
        }
        svg += "\"/>\n";
    }
    svg + "</svg>\n"
}

/// A round distance of which two to five fit.
fn ring(reach_m: f64) -> f64 {
    let steps = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    let fits = steps.into_iter().find(|step| reach_m / step <= 5.0);
    fits.unwrap_or(200.0)
}

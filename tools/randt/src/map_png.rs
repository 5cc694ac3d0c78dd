//! `map.png`: the map as a picture for people, with its path and a scale. Components that no loop
//! has joined stand beside it, because where they lie is not known.

use crate::components::{Components, Line};
use anyhow::{Context, ensure};
use randt_evaluation::Trajectory;
use randt_mapper::occupancy::Picture;

/// A small map is enlarged by a whole number up to about this many pixels in width, ...
const WIDTH_PX: usize = 1000;
/// ... or this many times.
const ENLARGED_MAX: usize = 8;
/// Around everything, and between the map and what stands beside it, pixels.
const MARGIN_PX: usize = 16;
/// For the scale below the map, pixels.
const FOOTER_PX: usize = 40;
/// Colours are one byte a pixel: as large as a grid's own picture may be.
const PIXELS_MAX: usize = 1 << 28;
/// A pixel of a letter, pixels.
const DOT_PX: usize = 3;

const BACKGROUND: u8 = 0;
const UNKNOWN: u8 = 1;
const FREE: u8 = 2;
const OCCUPIED: u8 = 3;
const PATH: u8 = 4;
const APART: u8 = 5;
const INK: u8 = 6;
const PALETTE: [[u8; 3]; 7] = [
    [255, 255, 255],
    [205, 209, 214],
    [250, 250, 248],
    [34, 34, 40],
    [214, 74, 28],
    [116, 78, 190],
    [34, 34, 40],
];

/// The picture as a file's bytes. `component`: the one that the grid shows; each pose of the
/// trajectory names its own as its frame.
pub fn map_png(grid: &Picture, trajectory: &Trajectory, component: u64) -> anyhow::Result<Vec<u8>> {
    let enlarged = (WIDTH_PX / grid.width.max(1)).clamp(1, ENLARGED_MAX);
    let scale = Scale {
        px_per_m: enlarged as f64 / grid.resolution_m,
    };
    let map_px = [grid.width * enlarged, grid.height * enlarged];
    let parts = Components::from_trajectory(trajectory, component);
    let apart = parts.apart.iter().map(|lines| Apart::new(lines, &scale));
    let apart: Vec<Apart> = apart.collect();

    let beside_px = apart.iter().map(|it| it.size_px[0]).max();
    let beside_px = beside_px.map_or(0, |width| width.max(word_px(NOT_JOINED)) + MARGIN_PX);
    let stacked_px: usize = apart.iter().map(|it| it.size_px[1] + MARGIN_PX).sum();
    let stacked_px = stacked_px + 2 * LETTER[1] * DOT_PX;
    let width = map_px[0].max(word_px("1000 m")) + beside_px + 2 * MARGIN_PX;
    let height = (map_px[1] + FOOTER_PX).max(stacked_px) + 2 * MARGIN_PX;
    let is_drawn = width
        .checked_mul(height)
        .is_some_and(|size| size <= PIXELS_MAX);
    ensure!(
        is_drawn,
        "{width} x {height} pixels are too many for a picture"
    );

    let mut canvas = Canvas::new(width, height);
    let corner = [MARGIN_PX, MARGIN_PX];
    canvas.grid(grid, enlarged, corner);
    // Rows go down, and the map's y goes up.
    let top_m = grid.origin_m[1] + grid.height as f64 * grid.resolution_m;
    let left_top_m = [grid.origin_m[0], top_m];
    for positions in &parts.lines {
        canvas.line(positions, &scale, left_top_m, corner, PATH);
    }
    let mut at = [
        MARGIN_PX + width - 2 * MARGIN_PX - beside_px + MARGIN_PX,
        MARGIN_PX,
    ];
    if !apart.is_empty() {
        canvas.word(NOT_JOINED, at, APART);
        at[1] += 2 * LETTER[1] * DOT_PX;
    }
    for it in &apart {
        for positions in it.lines {
            canvas.line(positions, &scale, it.left_top_m, at, APART);
        }
        at[1] += it.size_px[1] + MARGIN_PX;
    }
    canvas.scale(
        &scale,
        map_px[0],
        [MARGIN_PX, MARGIN_PX + map_px[1] + MARGIN_PX],
    );
    canvas.encode()
}

/// How large a metre is.
struct Scale {
    px_per_m: f64,
}

impl Scale {
    fn px(&self, length_m: f64) -> usize {
        // From below 0 and from what is not a number it becomes 0.
        (length_m * self.px_per_m) as usize
    }
}

/// The path of a component that is not joined, in a frame of its own.
struct Apart<'a> {
    lines: &'a [Line],
    left_top_m: [f64; 2],
    size_px: [usize; 2],
}

impl<'a> Apart<'a> {
    fn new(lines: &'a [Line], scale: &Scale) -> Self {
        let extreme = |axis: usize, better: fn(f64, f64) -> f64| {
            let values = lines.iter().flatten().filter_map(|at| at.get(axis));
            values.copied().reduce(better).unwrap_or_default()
        };
        let (left, right) = (extreme(0, f64::min), extreme(0, f64::max));
        let (bottom, top) = (extreme(1, f64::min), extreme(1, f64::max));
        Self {
            lines,
            left_top_m: [left, top],
            size_px: [scale.px(right - left) + 3, scale.px(top - bottom) + 3],
        }
    }
}

/// Pixels, row by row from above, as numbers of colours.
struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            pixels: vec![BACKGROUND; width * height],
        }
    }

    fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], colour: u8) {
        for row in y..(y + height).min(self.height) {
            let end = (x + width).min(self.width);
            let span = row * self.width + x..row * self.width + end;
            if let Some(span) = self.pixels.get_mut(span) {
                span.fill(colour);
            }
        }
    }

    fn grid(&mut self, grid: &Picture, enlarged: usize, [left, top]: [usize; 2]) {
        for (row, cells) in grid.pixels.chunks_exact(grid.width.max(1)).enumerate() {
            for (column, cell) in cells.iter().enumerate() {
                // As map_server tells them apart.
                let colour = match cell {
                    0..90 => OCCUPIED,
                    206.. => FREE,
                    _ => UNKNOWN,
                };
                let at = [left + column * enlarged, top + row * enlarged];
                self.fill(at, [enlarged; 2], colour);
            }
        }
    }

    /// A line through positions, 3 pixels thick.
    fn line(
        &mut self,
        positions: &[[f64; 2]],
        scale: &Scale,
        [left_m, top_m]: [f64; 2],
        [left, top]: [usize; 2],
        colour: u8,
    ) {
        let px =
            |[x_m, y_m]: [f64; 2]| [left + scale.px(x_m - left_m), top + scale.px(top_m - y_m)];
        for pair in positions.windows(2) {
            let [from, to] = [pair.first(), pair.last()].map(|it| px(*it.unwrap_or(&[0.0; 2])));
            let steps = from[0].abs_diff(to[0]).max(from[1].abs_diff(to[1])).max(1);
            for step in 0..=steps {
                let between = |axis: fn([usize; 2]) -> usize| {
                    (axis(from) * (steps - step) + axis(to) * step) / steps
                };
                let at = [between(|[x, _]| x), between(|[_, y]| y)];
                self.fill(at.map(|axis| axis.saturating_sub(1)), [3; 2], colour);
            }
        }
    }

    /// A bar of a round length, about a fifth of the map's width, and how long that is.
    fn scale(&mut self, scale: &Scale, map_px: usize, [x, y]: [usize; 2]) {
        let wanted_m = (map_px.max(200) / 5) as f64 / scale.px_per_m;
        let round = [
            0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0,
        ];
        let smaller = round
            .into_iter()
            .rev()
            .find(|length_m| *length_m <= wanted_m);
        let length_m = smaller.unwrap_or(0.1);
        let length_px = scale.px(length_m);
        self.fill([x, y], [length_px, 4], INK);
        for end in [x, x + length_px.saturating_sub(2)] {
            self.fill([end, y - 4], [2, 12], INK);
        }
        self.word(
            &format!("{length_m} m"),
            [x + length_px + MARGIN_PX, y - 5],
            INK,
        );
    }

    fn word(&mut self, word: &str, [x, y]: [usize; 2], colour: u8) {
        for (letter, at) in word.chars().zip(0..) {
            let left = x + at * (LETTER[0] + 1) * DOT_PX;
            for (row, dots) in glyph(letter).into_iter().enumerate() {
                for column in (0..LETTER[0]).filter(|column| dots & (4 >> column) != 0) {
                    let at = [left + column * DOT_PX, y + row * DOT_PX];
                    self.fill(at, [DOT_PX; 2], colour);
                }
            }
        }
    }

    fn encode(&self) -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let size = [self.width, self.height].map(u32::try_from);
        let [Ok(width), Ok(height)] = size else {
            anyhow::bail!("{} x {} pixels", self.width, self.height);
        };
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(PALETTE.concat());
        let mut writer = encoder.write_header().context("PNG")?;
        writer.write_image_data(&self.pixels).context("PNG")?;
        writer.finish().context("PNG")?;
        Ok(bytes)
    }
}

const NOT_JOINED: &str = "not joined";
/// Dots of a letter, in x and y.
const LETTER: [usize; 2] = [3, 5];

fn word_px(word: &str) -> usize {
    word.len() * (LETTER[0] + 1) * DOT_PX
}

/// Rows of dots from above, three bits each.
fn glyph(letter: char) -> [u8; 5] {
    match letter {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '5' => [7, 4, 7, 1, 7],
        '.' => [0, 0, 0, 0, 2],
        'm' => [0, 0, 7, 7, 5],
        'n' => [0, 0, 6, 5, 5],
        'o' => [0, 0, 7, 5, 7],
        't' => [2, 7, 2, 2, 3],
        'j' => [1, 0, 1, 5, 7],
        'i' => [2, 0, 2, 2, 2],
        'e' => [0, 7, 7, 4, 7],
        'd' => [1, 1, 7, 5, 7],
        _ => [0; 5],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Pose2;

    /// Width and pixels of a picture, as numbers of colours.
    fn decoded(bytes: &[u8]) -> (usize, Vec<u8>) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width as usize, pixels)
    }

    #[test]
    fn path_and_scale_are_on_the_map_and_what_is_not_joined_is_beside_it() {
        // 20 m x 10 m, with a wall along its lower edge.
        let (width, height) = (200, 100);
        let mut pixels = vec![254; width * height];
        pixels[(height - 1) * width..].fill(0);
        let grid = Picture {
            width,
            height,
            resolution_m: 0.1,
            origin_m: [-5.0, -2.0],
            pixels,
        };
        let mut trajectory = Trajectory::stamped();
        for (stamp_ns, (frame, x_m, y_m)) in
            (0..).zip([(0, -4.0, 0.0), (0, 4.0, 0.0), (7, 0.0, 0.0), (7, 3.0, 2.0)])
        {
            trajectory.push(stamp_ns, frame, Pose2::new(x_m, y_m, 0.0));
        }
        let (width_px, pixels) = decoded(&map_png(&grid, &trajectory, 0).unwrap());
        let count = |colour: u8| pixels.iter().filter(|pixel| **pixel == colour).count();
        // 5 pixels a cell. The path is 8 m long and three pixels thick.
        let at = |x_m: f64, y_m: f64| {
            let x = MARGIN_PX + ((x_m + 5.0) * 50.0) as usize;
            let y = MARGIN_PX + ((8.0 - y_m) * 50.0) as usize;
            pixels[y * width_px + x]
        };
        assert_eq!(
            (at(0.0, 0.0), at(0.0, 3.0), at(5.0, 0.0)),
            (PATH, FREE, FREE)
        );
        assert_eq!((at(0.0, -1.97), at(14.9, -1.97)), (OCCUPIED, OCCUPIED));
        assert_eq!(count(PATH), (8 * 50 + 3) * 3);
        // 2 m, the longest round length of at most a fifth of 20 m.
        let bars = pixels.chunk_by(|a, b| a == b).filter(|run| run[0] == INK);
        assert_eq!(bars.map(<[u8]>::len).max(), Some(2 * 50));
        assert!(count(APART) > 150 * 3, "{}", count(APART));
        // The largest component alone has nothing beside it.
        let (alone_px, _) = decoded(&map_png(&grid, &Trajectory::stamped(), 0).unwrap());
        assert!(alone_px < width_px);
    }
}

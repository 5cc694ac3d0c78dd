//! Rays: what each beam of a keyframe says of the space before it.

use super::GridKeyframe;

/// A ray of more cells is cut: no map is made of what lies so far, and a broken keyframe must not ask for all memory.
const CELLS_MAX: f64 = 1024.0;
/// Free ends this far before the first return, cells: a return stands anywhere in its cell.
const MARGIN: f64 = 1.0;

/// One beam with returns, in cells, in the keyframe's `base_link`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    /// Where the beam began.
    pub origin: [f64; 2],
    /// Up to here nothing came back.
    pub free_end: [f64; 2],
    /// The strongest return; `None` beyond the farthest that counts.
    pub hit: Option<[f64; 2]>,
}

/// The rays of all beams that have returns. A beam without says nothing: a radar may be blind there.
///
/// The strongest return is the wall: the flanks around it are the width of the pulse. Between the first return and
/// the strongest nothing is said.
pub(crate) fn rays<'a>(
    keyframe: &'a GridKeyframe<'_>,
    cell_size_m: f64,
) -> impl Iterator<Item = Ray> + 'a {
    let total = keyframe.points.len();
    let end_of = move |beam: usize| {
        let next = keyframe.beams.get(beam + 1);
        next.map_or(total, |next| next.first_point as usize)
            .min(total)
    };
    let cells = move |x_m: f32, y_m: f32| [x_m, y_m].map(|c| f64::from(c) / cell_size_m);
    let beams = keyframe.beams.iter().enumerate();
    beams.filter_map(move |(index, beam)| {
        let points = keyframe
            .points
            .get(beam.first_point as usize..end_of(index))?;
        let first = points.first()?;
        let strongest = points.iter().fold(first, |best, point| {
            if point.intensity > best.intensity {
                point
            } else {
                best
            }
        });
        let origin = cells(beam.x_m, beam.y_m);
        let hit = cells(strongest.x_m, strongest.y_m);
        let first = cells(first.x_m, first.y_m);
        let reach = distance(origin, hit);
        let clear = distance(origin, first);
        if !(reach.is_finite() && clear.is_finite() && distance([0.0; 2], origin) <= CELLS_MAX) {
            return None;
        }
        let share = (clear - MARGIN).clamp(0.0, CELLS_MAX) / clear.max(MARGIN);
        let toward =
            |axis: fn([f64; 2]) -> f64| axis(origin) + (axis(first) - axis(origin)) * share;
        Some(Ray {
            origin,
            free_end: [toward(|p| p[0]), toward(|p| p[1])],
            hit: (reach <= CELLS_MAX).then_some(hit),
        })
    })
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dy * dy).sqrt()
}

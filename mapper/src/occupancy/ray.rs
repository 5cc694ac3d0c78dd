//! Rays: what each beam of a keyframe shows of the space before it.

use crate::keyframe::Observation;

/// A ray of more cells is cut: no map is made of what lies so far, and a broken keyframe must not
/// ask for all memory.
const CELLS_MAX: f64 = 1024.0;
/// Free ends this far before the first return, cells: a return stands anywhere in its cell.
const MARGIN: f64 = 1.0;
/// A return this far behind those of both neighbouring beams is no opening that one beam found, m:
/// beams are wider than the angle between them, so that an opening shows in two. It is an echo
/// through the wall, or of a mirror.
const LONE_M: f64 = 0.5;

/// One beam with returns, in cells, in the keyframe's `base_link`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    /// Where the beam began.
    pub origin: [f64; 2],
    /// Up to here nothing came back.
    pub free_end: [f64; 2],
    /// Where something stands; `None` where that is not to be believed.
    pub hit: Option<[f64; 2]>,
}

/// A beam's cluster of returns, in cells.
#[derive(Clone, Copy, Debug)]
struct Echo {
    origin: [f64; 2],
    first: [f64; 2],
    strongest: [f64; 2],
    /// Range of the first return.
    clear: f64,
    /// Range of the strongest.
    reach: f64,
}

/// Makes the rays of one keyframe after the other, without allocating for each.
#[derive(Clone, Debug)]
pub(crate) struct RayMaker {
    cell_size_m: f64,
    echoes: Vec<Option<Echo>>,
    rays: Vec<Ray>,
}

impl RayMaker {
    /// Nothing made yet.
    pub fn new(cell_size_m: f64) -> Self {
        Self {
            cell_size_m,
            echoes: Vec::new(),
            rays: Vec::new(),
        }
    }

    /// Makes the rays of all beams that have returns. A beam without returns has no vote: a radar
    /// may be blind there.
    ///
    /// The strongest return is the wall: the flanks around it are the width of the pulse. Between
    /// the first return and the strongest there is no vote.
    pub fn make(&mut self, observation: &Observation) -> &[Ray] {
        let count = observation.beams.len();
        self.echoes.clear();
        let echoes = (0..count).map(|beam| Echo::from_beam(observation, beam, self.cell_size_m));
        self.echoes.extend(echoes);
        self.rays.clear();
        for (beam, echo) in self.echoes.iter().enumerate() {
            let Some(echo) = echo else { continue };
            // The sweep is a turn: its last beam is the first one's neighbour.
            let beside = [(beam + count - 1) % count, (beam + 1) % count];
            let beside = beside.map(|beam| Some(self.echoes.get(beam)?.as_ref()?.reach));
            let farther = match beside {
                [Some(a), Some(b)] => a.max(b),
                [one, other] => one.or(other).unwrap_or(f64::INFINITY),
            };
            let is_lone = echo.reach > farther + LONE_M / self.cell_size_m;
            let free = (echo.clear.min(farther) - MARGIN).clamp(0.0, CELLS_MAX);
            let share = free / echo.clear.max(MARGIN);
            let ([x, y], [to_x, to_y]) = (echo.origin, echo.first);
            self.rays.push(Ray {
                origin: echo.origin,
                free_end: [x + (to_x - x) * share, y + (to_y - y) * share],
                hit: (!is_lone && echo.reach <= CELLS_MAX).then_some(echo.strongest),
            });
        }
        &self.rays
    }
}

impl Echo {
    /// The echo of one beam; `None` where it has no returns, or nonsense.
    fn from_beam(observation: &Observation, beam: usize, cell_size_m: f64) -> Option<Self> {
        let (beams, total) = (&observation.beams, observation.points.len());
        let next = beams.get(beam + 1);
        let end = next.map_or(total, |next| next.first_point as usize);
        let beam = beams.get(beam)?;
        let points = beam.first_point as usize..end.min(total);
        let points = observation.points.get(points)?;
        let (first, mut strongest) = (points.first()?, points.first()?);
        for point in points {
            if point.intensity > strongest.intensity {
                strongest = point;
            }
        }
        let cells = |x_m: f32, y_m: f32| [x_m, y_m].map(|c| f64::from(c) / cell_size_m);
        let origin = cells(beam.x_m, beam.y_m);
        let first = cells(first.x_m, first.y_m);
        let strongest = cells(strongest.x_m, strongest.y_m);
        let echo = Self {
            origin,
            first,
            strongest,
            clear: distance(origin, first),
            reach: distance(origin, strongest),
        };
        // What is not a number is not below either.
        let is_sound = distance([0.0; 2], origin) <= CELLS_MAX
            && echo.clear < f64::INFINITY
            && echo.reach < f64::INFINITY;
        is_sound.then_some(echo)
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dy * dy).sqrt()
}

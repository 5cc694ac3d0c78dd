//! A keyframe's vote on every cell around it: hit, miss or none. One keyframe, one vote a cell,
//! however many beams.

use super::lattice::Placement;
use super::ray::Ray;

/// No beam passed.
pub(crate) const NONE: u8 = 0;
/// A beam passed on its way.
pub(crate) const MISS: u8 = 1;
/// A beam came back from here, whether or not others passed.
pub(crate) const HIT: u8 = 2;
/// Bits behind the point while a ray is walked.
const FRACTION_BITS: u32 = 16;
/// A whole cell there.
const ONE: f64 = (1 << FRACTION_BITS) as f64;

/// Votes on a rectangle of cells. Kept and painted anew, so that nothing is allocated for each
/// keyframe.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stencil {
    /// Cell of the lower left corner.
    pub corner: [i32; 2],
    /// Cells in x and in y.
    pub size: [usize; 2],
    votes: Vec<u8>,
    rays: Vec<Ray>,
}

impl Stencil {
    /// Paints a keyframe's rays where its pose puts them.
    pub fn paint(&mut self, rays: &[Ray], placement: &Placement) {
        self.rays.clear();
        self.rays.extend(rays.iter().map(|ray| Ray {
            origin: placement.apply(ray.origin),
            free_end: placement.apply(ray.free_end),
            hit: ray.hit.map(|hit| placement.apply(hit)),
        }));
        self.fit();
        let rays = std::mem::take(&mut self.rays);
        for ray in &rays {
            self.walk(ray.origin, ray.free_end);
        }
        for hit in rays.iter().filter_map(|ray| ray.hit) {
            let [column, row] = self.local(hit).map(|c| c as usize);
            self.set(column, row, HIT);
        }
        self.rays = rays;
    }

    /// The votes of one row from a column on.
    pub fn row(&self, row: usize, columns: std::ops::Range<usize>) -> &[u8] {
        let begin = row * self.size[0];
        let range = begin + columns.start..begin + columns.end;
        self.votes.get(range).unwrap_or_default()
    }

    /// The smallest rectangle that holds all rays, without a vote.
    fn fit(&mut self) {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for ray in &self.rays {
            for point in [ray.origin, ray.free_end].into_iter().chain(ray.hit) {
                least = [least[0].min(point[0]), least[1].min(point[1])];
                most = [most[0].max(point[0]), most[1].max(point[1])];
            }
        }
        self.votes.clear();
        if self.rays.is_empty() {
            self.size = [0; 2];
            return;
        }
        self.corner = least.map(|c| c.floor() as i32);
        let span = |least: f64, most: f64| (most.floor() - least.floor()) as usize + 1;
        self.size = [span(least[0], most[0]), span(least[1], most[1])];
        self.votes.resize(self.size[0] * self.size[1], NONE);
    }

    /// A point seen from the corner, cells.
    fn local(&self, point: [f64; 2]) -> [f64; 2] {
        let [left, bottom] = self.corner.map(f64::from);
        [point[0] - left, point[1] - bottom]
    }

    fn set(&mut self, column: usize, row: usize, vote: u8) {
        if let Some(cell) = self.votes.get_mut(row * self.size[0] + column) {
            *cell = vote;
        }
    }

    /// Votes MISS on the cells of a straight line, one for each step along its longer axis.
    fn walk(&mut self, from: [f64; 2], to: [f64; 2]) {
        let (from, to) = (self.local(from), self.local(to));
        let delta = [to[0] - from[0], to[1] - from[1]];
        let steps = delta[0].abs().max(delta[1].abs()).ceil().max(1.0);
        let fixed = |c: f64| (c * ONE) as i32;
        let step = delta.map(|d| fixed(d / steps));
        let mut at = from.map(fixed);
        for _ in 0..=steps as usize {
            let [column, row] = at.map(|c| (c >> FRACTION_BITS) as usize);
            self.set(column, row, MISS);
            at = [at[0] + step[0], at[1] + step[1]];
        }
    }
}

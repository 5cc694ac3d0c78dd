//! Where a query submap stands in a submap: NDT registration under an adaptive loss whose scale is
//! graduated.
//!
//! The paper's refinement of a loop candidate (III-D): the residual is that of odometry, r^2 = d^T
//! (R S R^T + S')^-1 d, and associations are made again before every step.

use super::submap::QuerySubmap;
use nalgebra::{Matrix3, Vector2, Vector3};
use randt_config::{Config, Odometry};
use randt_geometry::{
    Pose2,
    elementary::{atan2, sin_cos},
    marginalize_yaw,
};
use randt_ndt::{AdaptiveLoss, Association, Cell, Grid, ScanCell, evaluate};

/// Factors on c^2, one solve each: a loop starts farther from its end than a scan does, so the
/// basin begins wider.
const GRADUATION: [f64; 3] = [16.0, 4.0, 1.0];
/// Factor on c^2 along a line of poses, between which the basin must not be missed: half a cell.
const LINE_MU: f64 = 4.0;
/// Steps at the wide scales, which only lead into the next one's basin, and at the last.
const STEPS_WIDE: u32 = 3;
const STEPS_MAX: u32 = 8;
/// A step below this (m, rad) ends a scale: a tenth of the centimetre that a registration is good
/// for.
const STEP_MIN: f64 = 1e-3;
/// Longest step, m and rad: associations reach one cell.
const STEP_MAX: f64 = 0.5;
/// Added to the diagonal of the normal equations, per unit of it, so that a bare corridor does not
/// run away.
const DAMPING: f64 = 1e-3;

/// What odometry's warp inside query and submap adds to every registration, m and rad. Against the
/// truth of simulated drives loops are off by 2 cm and 0.3 degrees, with any noise of the scans;
/// and loops a metre apart share most of their 8 m of query and submap, so that each counts for an
/// eighth: three times these.
const WARP_SIGMA: [f64; 3] = [0.06, 0.06, 0.018];

/// A query is moved by this many cells to see whether it fits there as well: no whole number, as
/// cells repeat themselves.
const DISPLACED_CELLS: f64 = 1.4;

/// A query's pose in a submap, and how well it fits there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Pose of the query submap's newest keyframe in the frame of the submap's root.
    pub submap_from_query: Pose2,
    /// Information about x, y, yaw in the query submap's frame.
    pub information: Matrix3<f64>,
    /// Share of the query submap that the submap explains, 0..1.
    pub forward: f64,
    /// Share of the submap, as far as the query submap sees it, that the query submap explains,
    /// 0..1.
    pub backward: f64,
    /// Largest share that the submap explains of the query submap moved along its least certain
    /// direction, 0..1.
    pub displaced: f64,
}

impl Registration {
    /// The smaller share: both must agree.
    pub fn fit(&self) -> f64 {
        self.forward.min(self.backward)
    }

    /// Unit vector of the position's least certain direction, with the heading free, in the query
    /// submap's frame.
    pub fn weak_direction(&self) -> Vector2<f64> {
        let [a, b, c] = self.reduced();
        // Angle of the larger eigenvalue's axis; the smaller one's is across.
        let angle = 0.5 * atan2(2.0 * b, a - c);
        let (sin, cos) = sin_cos(angle);
        Vector2::new(-sin, cos)
    }

    /// Information about the position with the heading free: xx, xy, yy.
    fn reduced(&self) -> [f64; 3] {
        let mut information = self.information;
        // Rounding leaves it slightly asymmetric: the upper half counts.
        information.fill_lower_triangle_with_upper_triangle();
        let reduced = marginalize_yaw(&information);
        [reduced.m11, reduced.m12, reduced.m22]
    }

    /// Standard deviations along the least and most certain direction of the position, m, with the
    /// heading free.
    pub fn sigmas_m(&self) -> [f64; 2] {
        let [a, b, c] = self.reduced();
        let middle = 0.5 * (a + c);
        let radius = (0.25 * (a - c) * (a - c) + b * b).sqrt();
        [middle - radius, middle + radius].map(|l| 1.0 / l.max(f64::MIN_POSITIVE).sqrt())
    }
}

/// Registers query submaps; reuses its memory.
#[derive(Clone, Debug)]
pub struct Registrar {
    odometry: Odometry,
    range_m: f64,
    associations: Vec<Association>,
    seen: Vec<ScanCell>,
}

impl Registrar {
    /// Settings as odometry has them.
    pub fn new(config: &Config) -> Self {
        Self {
            odometry: config.odometry.clone(),
            range_m: config.range_used_m(),
            associations: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Finds the pose near `start`; `None` where nothing is alike.
    pub fn register(
        &mut self,
        map: &Grid,
        query: &QuerySubmap,
        start: &Pose2,
    ) -> Option<Registration> {
        let (cells, neighbours) = (&query.cells, self.odometry.neighbours as usize);
        let (alpha, scale) = (self.odometry.loss_alpha, self.odometry.loss_scale);
        let mut pose = *start;
        let mut hessian = Matrix3::zeros();
        for mu in GRADUATION {
            let loss = AdaptiveLoss::new(alpha, scale, mu);
            let steps = if mu > 1.0 { STEPS_WIDE } else { STEPS_MAX };
            for _ in 0..steps {
                Association::find(map, cells, &pose, neighbours, &mut self.associations);
                let normal = evaluate(cells, &self.associations, &pose, [0.0; 3], &loss);
                hessian = normal.pose;
                let mut damped = hessian;
                for i in 0..3 {
                    damped[(i, i)] *= 1.0 + DAMPING;
                }
                let step: Vector3<f64> = damped.cholesky()?.solve(&-normal.pose_gradient);
                let longest = step.amax();
                if !longest.is_finite() {
                    return None;
                }
                pose = pose.compose(&Pose2::exp(step * (STEP_MAX / longest).min(1.0)));
                if longest < STEP_MIN {
                    break;
                }
            }
        }
        let loss = AdaptiveLoss::new(alpha, scale, 1.0);
        let forward = self.explained(map, cells, &pose, &loss);
        let shares = (cells.len() * neighbours).max(1) as f64;
        let scan = (hessian * (self.odometry.ndt_weight / shares)).try_inverse()?;
        let warp = Matrix3::from_diagonal(&WARP_SIGMA.map(|sigma| sigma * sigma).into());
        let mut registration = Registration {
            submap_from_query: pose,
            information: (scan + warp).try_inverse()?,
            forward,
            backward: self.backward(map, query, &pose, &loss),
            displaced: 0.0,
        };
        registration.displaced = self.displaced(map, query, &registration, &loss);
        Some(registration)
    }

    /// The poses of a line at which the submap explains most of the query, the best first.
    pub fn maxima(&mut self, map: &Grid, query: &QuerySubmap, line: &[Pose2]) -> Vec<Pose2> {
        let (alpha, scale) = (self.odometry.loss_alpha, self.odometry.loss_scale);
        let loss = AdaptiveLoss::new(alpha, scale, LINE_MU);
        let explained = line.iter().map(|pose| {
            let share = self.explained(map, &query.cells, pose, &loss);
            (share, *pose)
        });
        let shares: Vec<(f64, Pose2)> = explained.collect();
        let share = |index: Option<usize>| index.and_then(|i| shares.get(i)).map_or(0.0, |s| s.0);
        let is_maximum = |(index, (here, _)): &(usize, &(f64, Pose2))| {
            *here > share(index.checked_sub(1)) && *here >= share(index.checked_add(1))
        };
        let maxima = shares.iter().enumerate().filter(is_maximum);
        let mut maxima: Vec<(f64, Pose2)> = maxima.map(|(_, maximum)| *maximum).collect();
        maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
        maxima.into_iter().map(|(_, pose)| pose).collect()
    }

    /// Share of the query submap that the submap still explains where the query submap is moved
    /// along the least certain direction: as much as before in a bare corridor, even where the
    /// information claims otherwise.
    fn displaced(
        &mut self,
        map: &Grid,
        query: &QuerySubmap,
        found: &Registration,
        loss: &AdaptiveLoss,
    ) -> f64 {
        let along = found.weak_direction() * DISPLACED_CELLS * map.cell_size_m();
        let explained = [1.0, -1.0].map(|sign| {
            let shift = Pose2::new(sign * along.x, sign * along.y, 0.0);
            let pose = found.submap_from_query.compose(&shift);
            self.explained(map, &query.cells, &pose, loss)
        });
        explained.into_iter().fold(0.0, f64::max)
    }

    /// Share of the submap around the query submap's end that the query submap explains.
    fn backward(
        &mut self,
        map: &Grid,
        query: &QuerySubmap,
        pose: &Pose2,
        loss: &AdaptiveLoss,
    ) -> f64 {
        // What the query submap's end does not see says nothing against it.
        let is_near = |cell: &&Cell| {
            let (dx, dy) = (cell.mean[0] - pose.x_m, cell.mean[1] - pose.y_m);
            dx * dx + dy * dy <= 0.25 * self.range_m * self.range_m
        };
        let mut seen = std::mem::take(&mut self.seen);
        seen.clear();
        let near = map.cells().filter(is_near);
        seen.extend(near.map(|cell| ScanCell::new(cell, 0.0)));
        let share = self.explained(&query.grid, &seen, &pose.inverse(), loss);
        self.seen = seen;
        share
    }

    /// Mean robust weight of the nearest counterparts that cells have in a map; one without counts
    /// as 0.
    fn explained(
        &mut self,
        map: &Grid,
        cells: &[ScanCell],
        pose: &Pose2,
        loss: &AdaptiveLoss,
    ) -> f64 {
        Association::find(map, cells, pose, 1, &mut self.associations);
        let found = self.associations.iter().filter(|found| found.count > 0);
        let sum: f64 = found.map(|found| loss.weight(found.nearest)).sum();
        sum / self.associations.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::KeyframeIdx;
    use crate::keyframe::{LazyObservation, MapKeyframe, Observation};
    use crate::verification::Submaps;
    use proptest::prelude::*;
    use randt_messages::KeyframePoint;

    /// What is seen from a pose: two rough walls along x, and with a `corner` two across.
    fn keyframe(pose: &Pose2, corner: bool) -> MapKeyframe {
        let inverse = pose.inverse();
        let points = (0..1600).map(|i| {
            let s = f64::from(i % 400) * 0.03 - 6.0;
            let rough = 0.01 * f64::from((i * 37) % 11);
            let p = match (i / 400, corner) {
                (0, _) | (2, false) => [s, 2.0 + rough],
                (1, _) | (3, false) => [s, -2.5 - rough],
                (2, true) => [5.0 + rough, s * 0.4],
                _ => [-3.0 - rough, s * 0.4],
            };
            let p = inverse.transform(p.into());
            KeyframePoint {
                x_m: p.x as f32,
                y_m: p.y as f32,
                intensity: (9.0 + 0.5 * f64::from((i * 53) % 7)) as f32,
                beam: 0,
                reserved: 0,
            }
        });
        MapKeyframe {
            keyframe_id: 0,
            stamp_ns: 0,
            odom_frame_id: 0,
            submap_root: 0,
            odom_from_base: Pose2::IDENTITY,
            step_covariance: Matrix3::identity(),
            speed_m_s: 0.0,
            turn_rad_s: 0.0,
            path_m: 0.0,
            drift_m2: 0.0,
            sees_all: true,
            observation: LazyObservation::from(Observation {
                beams: Vec::new(),
                points: points.collect(),
            }),
        }
    }

    fn register(pose: &Pose2, start: &Pose2, corner: bool) -> Registration {
        let config = Config::default();
        let mut submaps = Submaps::new(&config);
        let keyframes = [keyframe(&Pose2::IDENTITY, corner)];
        submaps.push(&keyframes);
        let mut query = QuerySubmap::new(&config);
        query.build(&[keyframe(pose, corner)]);
        let map = submaps.grid(KeyframeIdx(0), &keyframes).unwrap();
        Registrar::new(&config)
            .register(map, &query, start)
            .unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn a_room_is_registered_from_a_quarter_cell_away(
            x in -0.5..0.5, y in -0.3..0.3, yaw in -0.3..0.3, dx in -0.25..0.25, dy in -0.25..0.25, turn in -0.05..0.05,
        ) {
            let pose = Pose2::new(x, y, yaw);
            let found = register(&pose, &pose.compose(&Pose2::new(dx, dy, turn)), true);
            let off = pose.between(&found.submap_from_query);
            // Cells cut the walls where the robot stands: a few centimetres and a degree or two
            // are theirs.
            prop_assert!(off.translation().norm() < 0.08 && off.yaw_rad.abs() < 0.04, "{off:?}");
            prop_assert!(found.fit() > 0.5, "{found:?}");
        }
    }

    #[test]
    fn a_line_across_a_room_has_its_maximum_where_the_room_is() {
        let config = Config::default();
        let mut submaps = Submaps::new(&config);
        let keyframes = [keyframe(&Pose2::IDENTITY, true)];
        submaps.push(&keyframes);
        let mut query = QuerySubmap::new(&config);
        query.build(&keyframes);
        let map = submaps.grid(KeyframeIdx(0), &keyframes).unwrap();
        let line = |half: i32| Pose2::new(0.5 * f64::from(half), 0.0, 0.0);
        let line: Vec<Pose2> = (-6..=6).map(line).collect();
        let maxima = Registrar::new(&config).maxima(map, &query, &line);
        assert_eq!(maxima[0], Pose2::IDENTITY);
    }

    #[test]
    fn a_bare_corridor_does_not_say_how_far_along_it_is() {
        let at = |corner| {
            let [weak, strong] = register(&Pose2::IDENTITY, &Pose2::IDENTITY, corner).sigmas_m();
            weak / strong
        };
        let (corridor, room) = (at(false), at(true));
        assert!(corridor > 1.5 * room, "{corridor} {room}");
    }

    #[test]
    fn a_turned_room_is_not_explained() {
        let found = register(&Pose2::IDENTITY, &Pose2::new(0.0, 0.0, 1.57), true);
        let right = register(&Pose2::IDENTITY, &Pose2::IDENTITY, true);
        assert!(
            found.fit() < 0.6 * right.fit(),
            "{} {}",
            found.fit(),
            right.fit()
        );
    }
}

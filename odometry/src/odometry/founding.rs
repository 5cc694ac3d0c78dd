//! The first two scans of a frame: the map they found, and the speed they were made at.

use super::Odometry;
use nalgebra::Vector3;
use randt_geometry::Pose2;
use randt_ndt::{AdaptiveLoss, Association};

/// Cells from which a scan can found a map.
const FOUNDING_CELLS: usize = 5;
/// Speeds tried at a start differ by this share of a cell per scan: the solver's basin is half a cell.
const START_STEP_CELLS: f64 = 0.15;
/// Most speeds tried to each side, so that a start takes milliseconds also where cells are small.
const START_STEPS_MAX: f64 = 60.0;
/// Reverse speeds are tried up to a quarter of the forward ones.
const START_REVERSE_SHARE: i32 = 4;
/// A robot stands at the start unless another speed explains this much more: echoes agree by chance.
const START_GAIN_MIN: f64 = 1.1;

impl Odometry {
    /// Whether the frame's first scan is still in the window: it is then the map itself.
    pub(super) fn is_founding(&self) -> bool {
        self.settled.is_none()
    }

    /// A log may begin while the vehicle drives: the second scan is then metres from the first, and both are skewed.
    /// Tries forward speeds on both at once and starts from the one under which most cells find their like.
    pub(super) fn search_start_speed(&mut self) {
        let odometry = &self.config.odometry;
        let Some(dt_s) = self.slots.get(1).map(|slot| slot.dt_s) else {
            return;
        };
        let step_m_s = START_STEP_CELLS * self.config.cell_size_m() / dt_s.max(1e-3);
        let steps = (odometry.speed_max_m_s / step_m_s)
            .floor()
            .min(START_STEPS_MAX) as i32;
        let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0);
        let neighbours = odometry.neighbours as usize;
        let standing = self.support_at_speed(0.0, &loss, neighbours) * START_GAIN_MIN;
        let mut best = (standing, 0.0);
        for step in -steps / START_REVERSE_SHARE..=steps {
            let speed_m_s = f64::from(step) * step_m_s;
            let support = self.support_at_speed(speed_m_s, &loss, neighbours);
            if support > best.0 {
                best = (support, speed_m_s);
            }
        }
        self.support_at_speed(best.1, &loss, neighbours);
    }

    /// Sum of the robust weights of the second scan's cells where both scans were made at this forward speed.
    pub(super) fn support_at_speed(
        &mut self,
        speed_m_s: f64,
        loss: &AdaptiveLoss,
        neighbours: usize,
    ) -> f64 {
        let [first, second, ..] = self.slots.as_mut_slice() else {
            return 0.0;
        };
        let turned = first.state.pose.between(&second.state.pose).yaw_rad;
        (first.state.velocity.x, second.state.velocity.x) = (speed_m_s, speed_m_s);
        let twist = Vector3::new(speed_m_s * second.dt_s, 0.0, turned);
        second.state.pose = first.state.pose.compose(&Pose2::exp(twist));
        self.prepare(0);
        self.prepare(1);
        let [first, second, ..] = self.slots.as_mut_slice() else {
            return 0.0;
        };
        self.submaps.seed(&first.state.pose, &first.points);
        let submap = self.submaps.active();
        let pose = submap.root.between(&second.state.pose);
        Association::find(
            &submap.grid,
            &second.cells,
            &pose,
            neighbours,
            &mut second.associations,
        );
        second
            .associations
            .iter()
            .filter(|a| a.count > 0)
            .map(|a| loss.weight(a.nearest))
            .sum()
    }

    /// A first scan with too little in it founds nothing: the next one is the first.
    pub(super) fn found_later(&mut self) {
        let too_little = self
            .slots
            .first()
            .is_some_and(|slot| slot.cells.len() < FOUNDING_CELLS);
        if self.is_founding() && self.used == 1 && too_little {
            self.used = 0;
        }
    }
}

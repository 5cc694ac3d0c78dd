//! Scans that leave the window: the prior they leave behind, keyframes, submaps.

use super::{Odometry, Sink, predict::start_prior};
use crate::{keyframe::step_covariance, window::Problem};

impl Odometry {
    /// Where the window is full, lets its oldest scan go: what it says stays as a prior, its points in the submap.
    pub(super) fn slide(&mut self, sink: &mut impl Sink) {
        if self.used < self.slots.len() {
            return;
        }
        if let [oldest, second, ..] = self.slots.as_slice() {
            let problem = Problem {
                prior: &self.prior,
                submap: self.submaps.active(),
                seeded: self.is_founding(),
                config: &self.config,
            };
            let marginal = self.solver.marginalise(oldest, second, &problem);
            // A window without a solution starts again from where it stands.
            self.prior = marginal.unwrap_or_else(|| start_prior(&second.state, &self.config));
        }
        self.settle_oldest(sink);
    }

    pub(super) fn settle_all(&mut self, sink: &mut impl Sink) {
        while self.used > 0 {
            self.settle_oldest(sink);
        }
    }

    /// The oldest scan leaves the window: de-skewed once more by its final state, it becomes a keyframe where one is
    /// due and enters the submaps.
    pub(super) fn settle_oldest(&mut self, sink: &mut impl Sink) {
        self.deskew(0);
        let Some(slot) = self.slots.first() else {
            return;
        };
        let state = slot.state;
        if let Some(last) = &self.settled {
            let relative = last.pose.between(&state.pose);
            let step = step_covariance(slot, &self.config);
            self.keyframes.propagate(&relative, &step);
        } else {
            // The founding scan was the map; now it enters for good.
            self.submaps.seed(&state.pose, &[]);
        }
        if self.keyframes.is_due(&state.pose) {
            self.submaps
                .open_next(self.keyframes.next_id(), &state.pose);
            let submap = (
                self.submaps.active().id,
                self.submaps.active().root_keyframe,
            );
            sink.keyframe(self.keyframes.make(slot, self.frame.id, submap).as_ref());
        }
        let moved = self.inserted.is_none_or(|last| {
            let relative = last.between(&state.pose);
            relative.translation().norm() >= self.config.submap.insert_distance_m
                || relative.yaw_rad.abs() >= self.config.submap.insert_angle_rad
        });
        if moved {
            self.submaps.insert(&state.pose, &slot.points);
            self.inserted = Some(state.pose);
        }
        self.leaving = Some((slot.scan.head.header.stamp_ns, state.pose));
        self.settled = Some(state);
        self.slots.rotate_left(1);
        self.used -= 1;
    }
}

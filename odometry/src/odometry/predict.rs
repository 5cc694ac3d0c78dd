//! Where motion model and gyro say that a new scan is.

use super::Odometry;
use crate::{
    heading::{GyroTerm, Heading},
    scan,
    state::{State, StateMatrix},
    tilt::Tilt,
    window::Prior,
};
use nalgebra::{SVector, Vector3};
use randt_config::Config;
use randt_geometry::{Pose2, elementary::wrap};
use randt_messages::{ImuUse, Message, RadarPoints};
use randt_ndt::NormalEquations;

/// The first pose is where it is by definition; a number that keeps the equations regular, m and rad.
const ORIGIN_SIGMA: f64 = 1e-4;
/// Sideways speed and yaw rate at a start, m/s and rad/s: a vehicle drives forward.
const START_SIDEWAYS_SIGMA: f64 = 1.0;
/// Gyro coverage of a sweep may lack this much, s: two samples at 250 Hz.
const UNCOVERED_MAX_S: f64 = 0.01;

impl Odometry {
    /// Puts the scan into the window with its state predicted by motion model and gyro.
    pub(super) fn predict(&mut self, points: &Message<RadarPoints>) -> ImuUse {
        let before = self
            .used
            .checked_sub(1)
            .and_then(|i| self.slots.get(i))
            .map(|slot| (slot.state, slot.scan.head.sweep.end_ns));
        let end_ns = points.head.sweep.end_ns;
        let begin_ns = before.map_or(points.head.sweep.begin_ns, |(_, last_ns)| {
            last_ns.min(points.head.sweep.begin_ns)
        });
        let sweep = self
            .heading
            .as_ref()
            .and_then(|heading| heading.turn(begin_ns, end_ns));
        let covered = sweep.is_some_and(|turn| turn.uncovered_s <= UNCOVERED_MAX_S);
        let moment = self
            .heading
            .as_ref()
            .and_then(|heading| heading.moment(end_ns))
            .filter(|_| covered);
        let standstill = self.standstill.take().filter(|_| covered);
        let bias_rad_s = self
            .heading
            .as_ref()
            .map_or(0.0, |heading| heading.bias_rad_s().z);

        let Some(slot) = self.slots.get_mut(self.used) else {
            return ImuUse::None;
        };
        self.used += 1;
        scan::copy(points.as_ref(), &mut slot.scan);
        slot.gyro_covers_sweep = covered;
        slot.tilt = moment.map_or(Tilt::LEVEL, |(_, tilt)| tilt);
        slot.associations.clear();
        slot.ndt = NormalEquations::default();
        match before {
            Some((last, last_ns)) => {
                slot.dt_s = (end_ns - last_ns) as f64 * 1e-9;
                slot.gyro = moment.and_then(|(rate_rad_s, _)| {
                    let turn = self.heading.as_ref()?.turn(last_ns, end_ns)?;
                    Some(GyroTerm {
                        turn,
                        rate_rad_s,
                        standstill,
                    })
                });
                let mut twist = last.velocity * slot.dt_s;
                let mut velocity = last.velocity;
                if let Some(gyro) = &slot.gyro {
                    twist.z = wrap(gyro.turn.angle_rad - last.bias_rad_s * slot.dt_s);
                    velocity.z = gyro.rate_rad_s - last.bias_rad_s;
                }
                slot.state = State {
                    pose: last.pose.compose(&Pose2::exp(twist)),
                    velocity,
                    bias_rad_s: last.bias_rad_s,
                };
            }
            None => {
                (slot.dt_s, slot.gyro) = (0.0, None);
                let yaw_rate = moment.map_or(0.0, |(rate_rad_s, _)| rate_rad_s - bias_rad_s);
                slot.state = State {
                    pose: self.frame.origin,
                    velocity: Vector3::new(0.0, 0.0, yaw_rate),
                    bias_rad_s,
                };
                self.prior = start_prior(&slot.state, &self.config);
            }
        }
        let newest_ns = self.heading.as_ref().and_then(Heading::newest_ns);
        // What the gyro lacks at its end may be too little to do without it, but it is other bits.
        let reaches_end = newest_ns.is_some_and(|newest_ns| newest_ns >= end_ns);
        match sweep {
            Some(_) if covered && reaches_end => ImuUse::Covered,
            Some(turn) if turn.uncovered_s < (end_ns - begin_ns) as f64 * 1e-9 => {
                if self.counters.scans_imu_late == 0 {
                    self.counters.imu_late_first_ns = end_ns;
                    self.counters.imu_late_short_ns = (turn.uncovered_s * 1e9) as i64;
                }
                self.counters.scans_imu_late += 1;
                ImuUse::Late
            }
            Some(_) => {
                self.counters.scans_without_imu += 1;
                ImuUse::None
            }
            None => ImuUse::None,
        }
    }
}

/// At the start of a frame the pose is known by definition and the speed not at all.
pub(super) fn start_prior(state: &State, config: &Config) -> Prior {
    let odometry = &config.odometry;
    let speed = odometry.speed_max_m_s;
    let sigma = [
        ORIGIN_SIGMA,
        ORIGIN_SIGMA,
        ORIGIN_SIGMA,
        speed,
        START_SIDEWAYS_SIGMA,
        START_SIDEWAYS_SIGMA,
        odometry.gyro_bias_sigma_rad_s,
    ];
    let information = StateMatrix::from_diagonal(&SVector::from(sigma.map(|s| 1.0 / (s * s))));
    Prior {
        mean: *state,
        information,
    }
}

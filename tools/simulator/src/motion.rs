//! How the robot drives, and where it is at any instant.
//!
//! A driver steers along the route every 10 ms. Between two such knots forward speed, sideways
//! speed and yaw rate change linearly, and the pose is their integral: velocity is the pose's
//! derivative and acceleration the velocity's, by construction.

use crate::{Random, World, route::Route};
use nalgebra::Vector2;
use randt_geometry::Pose2;
use randt_geometry::elementary::{PI, atan2, cos, sin_cos};
use std::collections::VecDeque;

/// Time between two decisions of the driver.
const KNOT_NS: i64 = 10_000_000;
const KNOT_S: f64 = 0.01;
/// Below it a robot that brakes stands, m/s: its brakes hold.
const STANDING_M_S: f64 = 0.01;
/// Knots kept: 2 s, ten sweeps.
const KNOTS_KEPT: usize = 200;

/// Limits and habits of the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionProfile {
    /// Fastest speed.
    pub speed_max_m_s: f64,
    /// Fastest turn.
    pub yaw_rate_max_rad_s: f64,
    /// Hardest change of speed.
    pub acceleration_max_m_s2: f64,
    /// Hardest change of the turn.
    pub angular_acceleration_max_rad_s2: f64,
    /// Sideways slip: the robot wanders this far to either side of where its wheels point.
    pub slip_m: f64,
    /// Path between two wanderings.
    pub slip_length_m: f64,
    /// Standstill before the drive, s.
    pub start_s: f64,
    /// After this many changes of speed the robot stops; 0 never.
    pub stop_every: u32,
    /// At each stop the robot turns on the spot: by this angle to the left, twice as much to the
    /// right, and back; at every other stop the other way round. 0 never.
    pub turn_in_place_rad: f64,
}

impl Default for MotionProfile {
    /// A wheeled robot indoors: 0 to 1 m/s with stops, turns up to 0.7 rad/s, a centimetre of
    /// slip.
    fn default() -> Self {
        Self {
            speed_max_m_s: 1.0,
            yaw_rate_max_rad_s: 0.7,
            acceleration_max_m_s2: 0.5,
            angular_acceleration_max_rad_s2: 1.5,
            slip_m: 0.01,
            slip_length_m: 2.0,
            start_s: 2.5,
            stop_every: 5,
            turn_in_place_rad: 0.0,
        }
    }
}

impl MotionProfile {
    /// A drive that shows where the sensors sit (docs/calibrate.md): many stops, and turns on the
    /// spot at each.
    pub fn for_calibration(self) -> Self {
        Self {
            stop_every: 3,
            turn_in_place_rad: 2.0 * PI / 3.0,
            ..self
        }
    }
}

/// Where the robot is at one instant, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// `base_link` in the world; the yaw is not wrapped.
    pub pose: [f64; 3],
    /// Forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// Acceleration against the ground along forward and left, m/s^2, and angular acceleration,
    /// rad/s^2.
    pub acceleration: [f64; 3],
    /// Path driven so far, m.
    pub path_m: f64,
}

impl MotionState {
    /// The pose, wrapped.
    pub fn pose2(&self) -> Pose2 {
        Pose2::from_array(self.pose)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Knot {
    pose: [f64; 3],
    twist: [f64; 3],
    path_m: f64,
}

/// The drive. It can be asked for any instant not more than 1 s before the latest one it was asked
/// for.
#[derive(Clone, Debug)]
pub struct Drive {
    profile: MotionProfile,
    route: Route,
    random: Random,
    knots: VecDeque<Knot>,
    first: i64,
    speed_target_m_s: f64,
    next_decision_s: f64,
    decisions: u32,
    /// What is left of the turns on the spot, the next one last, and how many stops had some.
    turns_left_rad: Vec<f64>,
    turns: u32,
}

impl Drive {
    /// Begins at the route's start, at time 0, standing.
    pub fn new(world: &World, profile: MotionProfile, seed: u64) -> Self {
        let route = Route::new(&world.route_m);
        let (start, direction) = route.start();
        let knot = Knot {
            pose: [start.x, start.y, atan2(direction.y, direction.x)],
            ..Knot::default()
        };
        Self {
            profile,
            route,
            random: Random::new(seed, 1),
            knots: VecDeque::from([knot]),
            first: 0,
            speed_target_m_s: 0.0,
            next_decision_s: profile.start_s,
            decisions: 0,
            turns_left_rad: Vec::new(),
            turns: 0,
        }
    }

    /// The state at a time since the start; what is before the memory is answered with its oldest
    /// instant.
    pub fn at(&mut self, time_ns: i64) -> MotionState {
        let time_ns = time_ns.max(self.first * KNOT_NS);
        let index = time_ns / KNOT_NS;
        while self.first + (self.knots.len() as i64) < index + 2 {
            self.extend();
        }
        let offset = (index - self.first) as usize;
        let from = self.knots.get(offset).copied().unwrap_or_default();
        let to = self.knots.get(offset + 1).copied().unwrap_or(from);
        between(&from, to.twist, (time_ns - index * KNOT_NS) as f64 * 1e-9)
    }

    /// Times that the driver has passed the route's end.
    pub fn laps(&self) -> u32 {
        self.route.laps()
    }

    fn extend(&mut self) {
        let Some(&last) = self.knots.back() else {
            return;
        };
        let time_s = (self.first + self.knots.len() as i64 - 1) as f64 * KNOT_S;
        let twist = self.steer(&last, time_s);
        let state = between(&last, twist, KNOT_S);
        self.knots.push_back(Knot {
            pose: state.pose,
            twist,
            path_m: state.path_m,
        });
        if self.knots.len() > KNOTS_KEPT {
            self.knots.pop_front();
            self.first += 1;
        }
    }

    /// The twist 10 ms later: pure pursuit of the route within the robot's limits.
    fn steer(&mut self, knot: &Knot, time_s: f64) -> [f64; 3] {
        // Shorter and it weaves, longer and it cuts corners through door frames; a fast robot aims
        // farther ahead.
        const LOOKAHEAD_M: f64 = 0.6;
        const LOOKAHEAD_S: f64 = 0.5;
        const SPEED_TIME_S: f64 = 0.4;
        const TURN_TIME_S: f64 = 0.15;
        let limits = self.profile;
        let [x, y, yaw] = knot.pose;
        let [speed, _, turn] = knot.twist;
        if speed < STANDING_M_S
            && let Some(left_rad) = self.turns_left_rad.pop()
        {
            return self.turn_in_place(turn, left_rad, time_s);
        }
        // A turn on the spot is completed before anything else.
        if time_s >= self.next_decision_s && self.turns_left_rad.is_empty() {
            self.decide(time_s);
        }
        let position = Vector2::new(x, y);
        let target = self
            .route
            .ahead(position, LOOKAHEAD_M.max(LOOKAHEAD_S * speed));
        let curvature = target.map_or(0.0, |target| {
            let (sin, cos) = sin_cos(yaw);
            let offset = target - position;
            2.0 * (cos * offset.y - sin * offset.x) / offset.norm_squared()
        });
        // A little below the limit: the filter on the turn overshoots.
        let turn_max = 0.93 * limits.yaw_rate_max_rad_s;
        let slow = turn_max / curvature.abs().max(1e-9);
        let goal = self.speed_target_m_s.min(slow);
        let change = limits.acceleration_max_m_s2;
        let speed =
            (speed + KNOT_S * ((goal - speed) / SPEED_TIME_S).clamp(-change, change)).max(0.0);
        let goal = (curvature * speed).clamp(-turn_max, turn_max);
        let change = limits.angular_acceleration_max_rad_s2;
        let turn = turn + KNOT_S * ((goal - turn) / TURN_TIME_S).clamp(-change, change);
        // The derivative, along the path, of a sine of amplitude slip_m.
        let wave = 2.0 * PI / limits.slip_length_m;
        let sideways = limits.slip_m * wave * speed * cos(wave * knot.path_m);
        [speed, sideways, turn]
    }

    /// The twist 10 ms later of a robot that stands and turns: as fast as it can still brake.
    fn turn_in_place(&mut self, turn: f64, left_rad: f64, time_s: f64) -> [f64; 3] {
        let limits = self.profile;
        let change = KNOT_S * limits.angular_acceleration_max_rad_s2;
        // Half of the limit leaves room to follow.
        let braking = (limits.angular_acceleration_max_rad_s2 * left_rad.abs()).sqrt();
        let goal = left_rad.signum() * braking.min(0.93 * limits.yaw_rate_max_rad_s);
        let next = turn + (goal - turn).clamp(-change, change);
        let rest_rad = left_rad - 0.5 * (turn + next) * KNOT_S;
        if rest_rad * left_rad > 0.0 && rest_rad.abs() > 1e-3 {
            self.turns_left_rad.push(rest_rad);
        } else {
            self.next_decision_s = time_s + 1.0;
        }
        [0.0, 0.0, next]
    }

    fn decide(&mut self, time_s: f64) {
        self.decisions = self.decisions.wrapping_add(1);
        let stop = self.decisions.checked_rem(self.profile.stop_every) == Some(0);
        if stop && self.profile.turn_in_place_rad > 0.0 {
            let is_left = self.turns.is_multiple_of(2);
            let angle_rad = self.profile.turn_in_place_rad * if is_left { 1.0 } else { -1.0 };
            let turns = [angle_rad, -2.0 * angle_rad, angle_rad];
            self.turns_left_rad.extend(turns);
            self.turns = self.turns.wrapping_add(1);
        }
        (self.speed_target_m_s, self.next_decision_s) = if stop {
            (0.0, time_s + self.random.between(2.5, 4.0))
        } else {
            // Mostly near the limit, as a robot with a task.
            let share = self.random.unit();
            let speed = self.profile.speed_max_m_s * (1.0 - 0.7 * share * share);
            (speed, time_s + self.random.between(3.0, 8.0))
        };
    }
}

/// The state `after_s` behind a knot whose twist changes linearly to `to` within one knot's time.
fn between(from: &Knot, to: [f64; 3], after_s: f64) -> MotionState {
    // Gauss-Legendre, three points: exact to 1e-15 m over 10 ms.
    const NODES: [(f64, f64); 3] = [
        (0.112_701_665_379_258_3, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.887_298_334_620_741_7, 5.0 / 18.0),
    ];
    let rate = [0, 1, 2].map(|i: usize| match (from.twist.get(i), to.get(i)) {
        (Some(a), Some(b)) => (b - a) / KNOT_S,
        _ => 0.0,
    });
    let twist_at = |t: f64| {
        let [v, s, w] = from.twist;
        [v + rate[0] * t, s + rate[1] * t, w + rate[2] * t]
    };
    let [x, y, yaw] = from.pose;
    let yaw_at = |t: f64| yaw + from.twist[2] * t + 0.5 * rate[2] * t * t;
    let (mut dx, mut dy, mut path) = (0.0, 0.0, 0.0);
    for (node, weight) in NODES {
        let t = node * after_s;
        let [forward, left, _] = twist_at(t);
        let (sin, cos) = sin_cos(yaw_at(t));
        dx += weight * after_s * (cos * forward - sin * left);
        dy += weight * after_s * (sin * forward + cos * left);
        path += weight * after_s * (forward * forward + left * left).sqrt();
    }
    let [forward, left, turn] = twist_at(after_s);
    MotionState {
        pose: [x + dx, y + dy, yaw_at(after_s)],
        velocity: [forward, left, turn],
        acceleration: [rate[0] - turn * left, rate[1] + turn * forward, rate[2]],
        path_m: from.path_m + path,
    }
}

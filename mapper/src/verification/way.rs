//! How far the robot can have come, and turned, between two components of the map.
//!
//! Between frames of odometry it was in the dark, and how frames lie to each other is unknown. But
//! each of them says how far its end is from its beginning: of a way there and back through equal
//! corridors, what lies between them cannot be left out.

use crate::keyframe::MapKeyframe;
use randt_geometry::Pose2;
use randt_geometry::elementary::wrap;

/// Where the robot can have come to while nothing was seen: this many times its fastest speed so
/// far, and a little, m.
const REACH_SPEEDS: f64 = 1.5;
const REACH_MIN_M: f64 = 2.0;
/// In the dark it goes on turning as it did before and after. Between the two it may have sped up
/// its turn and slowed it down by this, rad/s^2: robots that spin do; and a little, rad, for the
/// first scans of a frame.
const TURN_RAD_S2: f64 = 5.0;
const TURN_MIN_RAD: f64 = 0.3;
/// Odometry may be off by this many standard deviations of what its steps add, ...
const DRIFT_DEVIATIONS: f64 = 3.0;
/// ... and by this share of the way, for headings that drift: four times what simulated drives
/// show.
const DRIFT_SHARE: f64 = 0.02;

/// A stretch of one frame of odometry.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    odom_frame_id: u64,
    begin: Pose2,
    end: Pose2,
    /// Path and variance of the position at its beginning, m and m^2.
    path_m: f64,
    drift_m2: f64,
    end_ns: i64,
    end_turn_rad_s: f64,
    /// By how much it may be longer or shorter than its ends say, m.
    slack_m: f64,
}

impl From<&MapKeyframe> for Stretch {
    fn from(keyframe: &MapKeyframe) -> Self {
        Self {
            odom_frame_id: keyframe.odom_frame_id,
            begin: keyframe.odom_from_base,
            end: keyframe.odom_from_base,
            path_m: keyframe.path_m,
            drift_m2: keyframe.drift_m2,
            end_ns: keyframe.stamp_ns,
            end_turn_rad_s: keyframe.turn_rad_s,
            slack_m: 0.0,
        }
    }
}

impl Stretch {
    fn go_on(&mut self, keyframe: &MapKeyframe) {
        let drift_m2 = (keyframe.drift_m2 - self.drift_m2).max(0.0);
        self.slack_m =
            DRIFT_DEVIATIONS * drift_m2.sqrt() + DRIFT_SHARE * (keyframe.path_m - self.path_m);
        (self.end, self.end_ns) = (keyframe.odom_from_base, keyframe.stamp_ns);
        self.end_turn_rad_s = keyframe.turn_rad_s;
    }

    fn turn_rad(&self) -> f64 {
        self.end.yaw_rad - self.begin.yaw_rad
    }

    fn length_m(&self) -> f64 {
        (self.end.translation() - self.begin.translation()).norm()
    }
}

/// The way since a keyframe.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    stretches: Vec<Stretch>,
    /// How far it can have come in the dark between them, m.
    dark_m: f64,
    /// How far it turned there, and by how much it may be more or less, rad.
    dark_rad: [f64; 2],
}

impl From<&MapKeyframe> for Way {
    fn from(keyframe: &MapKeyframe) -> Self {
        Self {
            stretches: vec![keyframe.into()],
            ..Self::default()
        }
    }
}

impl Way {
    /// To the next keyframe, of whichever frame.
    pub fn go_on(&mut self, keyframe: &MapKeyframe, fastest_m_s: f64) {
        match self.stretches.last_mut() {
            Some(last) if last.odom_frame_id == keyframe.odom_frame_id => last.go_on(keyframe),
            last => {
                if let Some(last) = last {
                    // A clock that was set between the frames gives no time.
                    let dark_s = keyframe.stamp_ns.abs_diff(last.end_ns) as f64 * 1e-9;
                    self.dark_m += REACH_MIN_M + REACH_SPEEDS * fastest_m_s * dark_s;
                    let rates = [last.end_turn_rad_s, keyframe.turn_rad_s];
                    let [turned, slack] = &mut self.dark_rad;
                    *turned += 0.5 * (rates[0] + rates[1]) * dark_s;
                    // Up half of the time and down the other half; and either rate for all of it.
                    *slack += TURN_MIN_RAD
                        + 0.5 * (rates[0] - rates[1]).abs() * dark_s
                        + 0.25 * TURN_RAD_S2 * dark_s * dark_s;
                }
                self.stretches.push(keyframe.into());
            }
        }
    }

    /// Whether its end may be there, seen from its beginning.
    pub fn may_end_at(&self, begin_from_end: &Pose2) -> bool {
        let distance_m = begin_from_end.translation().norm();
        let turned: f64 = self.stretches.iter().map(Stretch::turn_rad).sum();
        let [dark_rad, slack_rad] = self.dark_rad;
        // What is not finite says nothing.
        if wrap(begin_from_end.yaw_rad - turned - dark_rad).abs() > slack_rad
            && !self.stretches.is_empty()
        {
            return false;
        }
        let lengths = || self.stretches.iter().map(Stretch::length_m);
        let slacks: f64 = self.stretches.iter().map(|it| it.slack_m).sum();
        let (sum_m, slack_m) = (lengths().sum::<f64>(), self.dark_m + slacks);
        let longest_m = lengths().fold(0.0, f64::max);
        // All others lead straight back, or straight on.
        let least_m = longest_m - (sum_m - longest_m) - slack_m;
        (least_m..=sum_m + slack_m).contains(&distance_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{Keyframe, Message};

    /// A way through frames of odometry, each by its straight length and the seconds in the dark
    /// before it, at 1 m/s.
    fn way(frames: &[(f64, i64)]) -> Way {
        let mut before: Option<MapKeyframe> = None;
        let (mut way, mut stamp_ns) = (Way::default(), 0);
        for (frame, (length_m, dark_s)) in frames.iter().enumerate() {
            stamp_ns += dark_s * 1_000_000_000;
            for x_m in [0.0, *length_m] {
                let mut message = Message::<Keyframe>::default();
                message.head.odom_frame_id = frame as u64;
                message.head.header.stamp_ns = stamp_ns;
                message.head.pose = [x_m, 0.0, 0.0];
                let keyframe = MapKeyframe::new(message.as_ref(), before.as_ref());
                way.go_on(&keyframe, 1.0);
                before = Some(keyframe);
            }
        }
        way
    }

    fn ends_at(way: &Way, x_m: f64) -> bool {
        way.may_end_at(&Pose2::new(x_m, 0.0, 0.0))
    }

    #[test]
    fn it_goes_on_turning_as_it_did() {
        // Straight on, 0.6 s in the dark: 0.3 rad and 0.45 rad.
        let way = |rates: [f64; 2]| {
            let mut before: Option<MapKeyframe> = None;
            let mut way = Way::default();
            for (frame, rate) in rates.into_iter().enumerate() {
                let mut message = Message::<Keyframe>::default();
                message.head.odom_frame_id = frame as u64;
                message.head.header.stamp_ns = frame as i64 * 600_000_000;
                message.head.twist[2] = rate;
                let keyframe = MapKeyframe::new(message.as_ref(), before.as_ref());
                way.go_on(&keyframe, 1.0);
                before = Some(keyframe);
            }
            way
        };
        let turned = |way: &Way, yaw_rad| way.may_end_at(&Pose2::new(0.0, 0.0, yaw_rad));
        let straight = way([0.0, 0.0]);
        assert!(turned(&straight, 0.7) && turned(&straight, -0.7));
        assert!(!turned(&straight, 0.8) && !turned(&straight, -1.57) && !turned(&straight, 3.1));
        let in_a_curve = way([1.0, 1.0]);
        assert!(turned(&in_a_curve, 1.3) && !turned(&in_a_curve, -0.2));
        assert!(turned(&way([0.0, 1.0]), 0.0) && turned(&way([f64::NAN, 0.0]), 3.0));
    }

    #[test]
    fn what_lies_between_cannot_be_left_out() {
        // Out of the one, 30 m, into the other: 2 m and a second and a half in the dark each time,
        // and 0.6 m of drift.
        let way = way(&[(0.0, 0), (30.0, 1), (0.0, 1)]);
        assert!(!ends_at(&way, 0.0) && !ends_at(&way, 22.0));
        assert!(ends_at(&way, 23.0) && ends_at(&way, 37.0) && !ends_at(&way, 38.0));
    }

    #[test]
    fn there_and_back_may_end_where_it_began() {
        let way = way(&[(0.0, 0), (30.0, 1), (28.0, 1), (0.0, 1)]);
        assert!(ends_at(&way, 0.0) && ends_at(&way, 65.0) && !ends_at(&way, 75.0));
    }

    #[test]
    fn in_the_dark_it_comes_as_far_as_its_speed_takes_it() {
        let way = way(&[(0.0, 0), (0.0, 10)]);
        assert!(ends_at(&way, 0.0) && ends_at(&way, 16.9) && !ends_at(&way, 17.1));
    }
}

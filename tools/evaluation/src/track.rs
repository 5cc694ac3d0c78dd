//! Whether the track was held: the worst error of the motion over a second, and over ten metres.

use crate::Trajectory;
use crate::timeline::{Instant, Timeline, relative_error};

/// Lost track is judged by the motion over this time.
const SECOND_NS: i64 = 1_000_000_000;
/// More than this in a second is no drift: the registration has gone elsewhere, m and degrees.
const LOST_M: f64 = 0.3;
const LOST_DEG: f64 = 8.0;
/// Path over which an error counts as a share, m: the length of a few rooms.
const PATH_M: f64 = 10.0;

/// The largest errors of a kind; translation and rotation each by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Metres; for a path, percent of its length.
    pub translation: f64,
    /// Degrees.
    pub rotation_deg: f64,
    /// Stamp at the begin of the stretch with the largest translation.
    pub translation_ns: i64,
    /// Stamp at the begin of the stretch with the largest rotation.
    pub rotation_ns: i64,
}

impl Worst {
    fn add(&mut self, translation: f64, rotation_deg: f64, stamp_ns: i64) {
        if translation > self.translation {
            (self.translation, self.translation_ns) = (translation, stamp_ns);
        }
        if rotation_deg > self.rotation_deg {
            (self.rotation_deg, self.rotation_ns) = (rotation_deg, stamp_ns);
        }
    }
}

/// How well the track was held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    /// Errors over one second, m and degrees; `None` where no second is covered.
    pub second: Option<Worst>,
    /// Errors over 10 m of the truth's path, percent of it and degrees; `None` where no frame is
    /// that long.
    pub ten_metres: Option<Worst>,
    /// Whether any second is off by more than 0.3 m or 8 degrees.
    pub lost: bool,
}

/// The worst relative errors, from every pose of the estimate on, inside one frame.
///
/// Rows without stamps have no seconds: they are not judged.
pub fn track(estimate: &Trajectory, truth: &Trajectory) -> Track {
    let (thought, there) = (Timeline::new(estimate), Timeline::new(truth));
    let both = |stamp_ns: i64| Some((thought.at(stamp_ns)?, there.at(stamp_ns)?));
    let instants: Vec<(i64, Instant, Instant)> = estimate
        .poses()
        .iter()
        .filter_map(|pose| both(pose.stamp_ns).map(|(a, b)| (pose.stamp_ns, a, b)))
        .collect();
    let (mut second, mut ten_metres) = (None, None);
    for (stamp_ns, estimated, is) in &instants {
        let later = stamp_ns.checked_add(SECOND_NS).and_then(both);
        if let Some(error) = later.and_then(|(e, t)| relative_error((estimated, is), (&e, &t))) {
            second.get_or_insert_with(Worst::default).add(
                error.distance_m(),
                error.angle_rad().to_degrees(),
                *stamp_ns,
            );
        }
        // The path never falls, so that the instants are in its order too.
        let end = instants.partition_point(|(_, _, to)| to.path_m < is.path_m + PATH_M);
        let end = instants.get(end);
        if let Some((error, to)) =
            end.and_then(|(_, e, t)| Some((relative_error((estimated, is), (e, t))?, t)))
        {
            ten_metres.get_or_insert_with(Worst::default).add(
                100.0 * error.distance_m() / (to.path_m - is.path_m),
                error.angle_rad().to_degrees(),
                *stamp_ns,
            );
        }
    }
    let too_far = |worst: Worst| worst.translation > LOST_M || worst.rotation_deg > LOST_DEG;
    Track {
        second,
        ten_metres,
        lost: second.is_some_and(too_far),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Pose2;

    /// 0.2 s a pose, half a metre a second, straight on, seen from `seen_from`.
    fn drive(count: i64, frame: impl Fn(i64) -> u64, error: impl Fn(i64) -> Pose2) -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        for pose in 0..count {
            let at = Pose2::new(0.1 * pose as f64, 0.0, 0.0);
            trajectory.push(pose * 200_000_000, frame(pose), error(pose).compose(&at));
        }
        trajectory
    }

    fn truth() -> Trajectory {
        drive(300, |_| 0, |_| Pose2::IDENTITY)
    }

    /// From pose 100 on the estimate stands off by `jump`.
    fn jumped(jump: Pose2) -> Track {
        let error = |pose: i64| if pose < 100 { Pose2::IDENTITY } else { jump };
        track(&drive(300, |_| 0, error), &truth())
    }

    #[test]
    fn where_the_frame_stands_is_no_error() {
        let seen = Pose2::new(4.0, -3.0, 2.0);
        let track = track(&drive(300, |_| 0, |_| seen), &truth());
        let worst = track.second.unwrap();
        assert!(worst.translation < 1e-9 && worst.rotation_deg < 1e-4);
        assert!(track.ten_metres.unwrap().translation < 1e-9);
        assert!(!track.lost);
    }

    #[test]
    fn lost_is_a_jump_of_a_third_of_a_metre_or_eight_degrees_in_a_second() {
        for (jump, lost) in [
            (Pose2::new(0.0, 0.29, 0.0), false),
            (Pose2::new(0.0, 0.31, 0.0), true),
            (Pose2::new(0.0, 0.0, 7.9_f64.to_radians()), false),
        ] {
            // A turn about the origin would also move: turn where the robot is.
            let at = Pose2::new(10.0, 0.0, 0.0);
            let track = jumped(at.compose(&jump).compose(&at.inverse()));
            assert_eq!(track.lost, lost, "{jump:?} {track:?}");
        }
        let at = Pose2::new(10.0, 0.0, 0.0);
        let turned = at
            .compose(&Pose2::new(0.0, 0.0, -0.15))
            .compose(&at.inverse());
        let track = jumped(turned);
        assert!(track.lost);
        let worst = track.second.unwrap();
        assert!((worst.rotation_deg - 0.15_f64.to_degrees()).abs() < 1e-6);
        // The first second that sees it begins five poses earlier.
        assert_eq!(worst.rotation_ns, 95 * 200_000_000);
    }

    #[test]
    fn slow_drift_shows_over_ten_metres() {
        let creep = |pose: i64| Pose2::new(0.006 * pose as f64, 0.0, 0.0);
        let track = track(&drive(300, |_| 0, creep), &truth());
        assert!((track.ten_metres.unwrap().translation - 6.0).abs() < 0.1);
        assert!((track.second.unwrap().translation - 0.03).abs() < 1e-9);
        assert!(!track.lost);
    }

    #[test]
    fn a_new_frame_is_no_jump() {
        let far = |pose: i64| Pose2::new(if pose < 100 { 0.0 } else { 50.0 }, 0.0, 0.0);
        let frame = |pose: i64| u64::from(pose >= 100);
        assert!(!track(&drive(300, frame, far), &truth()).lost);
        assert!(track(&drive(300, |_| 0, far), &truth()).lost);
    }

    #[test]
    fn what_is_too_short_or_has_no_stamps_is_not_judged() {
        let short = track(&drive(4, |_| 0, |_| Pose2::IDENTITY), &truth());
        assert_eq!(
            (short.second, short.ten_metres, short.lost),
            (None, None, false)
        );
        let mut rows = Trajectory::unstamped();
        (0..300).for_each(|n| rows.push(0, 0, Pose2::new(0.1 * n as f64, 0.0, 0.0)));
        assert_eq!(track(&rows, &rows).second, None);
    }
}

//! What is known of robot, latency and map, as names with values; short enough for 34 columns.

use super::snapshot::{Pose, Robot, Snapshot};
use crate::units::{count, or_dash, seconds};

/// What is older is shown with its age.
const OLD_S: f64 = 1.5;

/// A name and its value.
pub type Fact = (&'static str, String);

/// Where the robot is, how fast, how sure, and how late that is known.
pub fn robot(snapshot: &Snapshot) -> Vec<Fact> {
    let robot = snapshot.robot.as_ref();
    let latency = &snapshot.latency_ms;
    let degrees = f64::to_degrees;
    // In the map where that is known: the frame in which a robot is sent somewhere.
    let pose = robot.map(|robot| match &robot.map_pose {
        Some(pose) => (pose, "map"),
        None => (&robot.pose, "odom"),
    });
    let position =
        |(pose, frame): (&Pose, &str)| format!("{:.2}, {:.2} m {frame}", pose.x_m, pose.y_m);
    let turn = |[_, _, rate]: [f64; 3]| format!("{:.1} deg/s", degrees(rate));
    let speed = |[forward, left, _]: [f64; 3]| format!("{forward:.2}, {left:.2} m/s");
    let bias = |bias: [f64; 3]| {
        let [x, y, z] = bias.map(degrees);
        format!("{x:.2} {y:.2} {z:.2} deg/s")
    };
    let velocity = robot.map(|robot| robot.velocity);
    vec![
        ("position", or_dash(pose, position)),
        (
            "heading",
            or_dash(pose, |(pose, _)| {
                format!("{:.1} deg", degrees(pose.yaw_rad))
            }),
        ),
        ("velocity", or_dash(velocity, speed)),
        ("turning", or_dash(velocity, turn)),
        (
            "gyro bias",
            or_dash(robot.map(|robot| robot.gyro_bias_rad_s), bias),
        ),
        ("trust", or_dash(robot, trust)),
        ("wait", times(latency.wait_p50, latency.wait_p99)),
        ("compute", times(latency.compute_p50, latency.compute_p99)),
    ]
}

/// What the map holds.
pub fn map(snapshot: &Snapshot) -> Vec<Fact> {
    let map = snapshot.map.as_ref();
    vec![
        (
            "keyframes",
            or_dash(map, |map| {
                format!("{}, {} on disk", map.keyframes, map.on_disk)
            }),
        ),
        (
            "loops",
            or_dash(map, |map| {
                format!("{}, {} confirmed", map.loops, map.confirmed_loops)
            }),
        ),
        (
            "path",
            or_dash(map, |map| {
                format!("{:.1} m, {}", map.path_m, count(map.tiles, "tile", "tiles"))
            }),
        ),
        (
            "map",
            or_dash(map, |map| count(map.components, "component", "components")),
        ),
    ]
}

/// The trust, with its age where it is old, else with its first reason; the others are in a note.
fn trust(robot: &Robot) -> String {
    let trust = robot.trust;
    if robot.age_s > OLD_S {
        return format!("{trust}, {} ago", seconds(robot.age_s));
    }
    match (robot.trust_reasons.first(), robot.weak_direction_rad) {
        (None, _) => trust.to_owned(),
        (Some(&"weak"), Some(rad)) => format!("{trust}, weak {:+.0} deg", rad.to_degrees()),
        (Some(reason), _) => format!("{trust}, {reason}"),
    }
}

/// Median and 99th percentile.
fn times(p50: Option<f64>, p99: Option<f64>) -> String {
    or_dash(p50.zip(p99), |(p50, p99)| {
        format!("{p50:.1} ms, p99 {p99:.1} ms")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::top::snapshot::sample;

    #[test]
    fn facts_fit_their_place_and_have_a_dash_where_nothing_is_known() {
        let mut snapshot = sample();
        let known = (snapshot.robot.take(), snapshot.map.take());
        let latency = std::mem::take(&mut snapshot.latency_ms);
        let unknown = [robot(&snapshot), map(&snapshot)].concat();
        assert!(unknown.iter().all(|(_, value)| value == "-"), "{unknown:?}");
        (snapshot.robot, snapshot.map) = known;
        snapshot.latency_ms = latency;
        let known = [robot(&snapshot), map(&snapshot)].concat();
        assert!(
            known
                .iter()
                .all(|(name, value)| name.len() <= 9 && value.len() <= 24),
            "{known:?}"
        );
        assert_eq!(
            known[0],
            ("position", "-1234.57, -1234.57 m map".to_owned())
        );
        assert_eq!(known[4].1, "-0.57 -1.15 1.72 deg/s");
        assert_eq!(known[9].1, "12345, 12345 confirmed");
        assert_eq!(known[5].1, "degraded, 99 s ago");
        assert_eq!(known.len(), 12);
        let mut after = |change: fn(&mut Robot)| {
            let robot = snapshot.robot.as_mut().unwrap();
            change(robot);
            trust(robot)
        };
        assert_eq!(after(|it| it.age_s = 0.1), "degraded, weak -86 deg");
        let unsupported = after(|it| it.trust_reasons = vec!["unsupported", "fit"]);
        assert_eq!(unsupported, "degraded, unsupported");
        assert!(unsupported.len() <= 24);
        assert_eq!(after(|it| it.trust_reasons.clear()), "degraded");
    }
}

//! The picture of a drive.

use randt_evaluation::{Plot, plot_trajectories};
use randt_geometry::Pose2;

type Line = Vec<[f64; 2]>;

/// A drive of two laps through a hall with walls of points; the truth a hand beside it.
fn hall() -> (Vec<Line>, Line, Line) {
    let mut pose = Pose2::IDENTITY;
    let (mut first, mut second, mut truth) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..800 {
        let turn = if (step / 50) % 2 == 0 { 0.0 } else { 0.0314 };
        pose = pose.compose(&Pose2::exp([0.2, 0.0, turn].into()));
        let drift = 0.001 * f64::from(step);
        let lap = if step < 600 { &mut first } else { &mut second };
        lap.push([pose.x_m + drift, pose.y_m - drift]);
        truth.push([pose.x_m, pose.y_m]);
    }
    let mut map = Vec::new();
    for n in 0..30_000 {
        let along = f64::from(n % 3000) * 0.01;
        let noise = f64::from((n * 7919) % 101) * 0.001;
        map.push([-10.0 + along, -4.0 + noise]);
        map.push([-10.0 + noise, -4.0 + 0.8 * along]);
        map.push([20.0 - noise, -4.0 + 0.8 * along]);
        map.push([-10.0 + along, 20.0 - noise]);
    }
    (vec![first, second], truth, map)
}

#[test]
fn the_same_drive_gives_the_same_picture() {
    let (estimate, truth, map) = hall();
    let plot = Plot {
        title: "hall, two laps",
        estimate: &estimate,
        live: &estimate[..1],
        truth: &truth,
        map: &map,
        loops: &[[[0.0, 0.0], [10.0, 5.0]]],
        apart: &[vec![vec![[0.0, 0.0], [4.0, 1.0]]]],
    };
    let svg = plot_trajectories(&plot).unwrap();
    assert_eq!(svg, plot_trajectories(&plot).unwrap());
    for words in [
        "<svg",
        "</svg>",
        "hall, two laps",
        "estimate",
        "live",
        "truth",
        "loops",
        "not joined",
        "x, m",
    ] {
        assert!(svg.contains(words), "{words}");
    }
    // Points on one pixel are drawn once.
    assert!(svg.len() < 500_000, "{} bytes", svg.len());
    if let Some(path) = std::env::var_os("RANDT_PLOT") {
        std::fs::write(path, svg).unwrap();
    }
}

#[test]
fn nothing_and_nonsense_can_be_drawn() {
    assert!(plot_trajectories(&Plot::default()).is_ok());
    let nonsense = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0];
    let points: Vec<[f64; 2]> = nonsense
        .iter()
        .flat_map(|&x| nonsense.map(|y| [x, y]))
        .collect();
    let plot = Plot {
        title: "<&>",
        estimate: std::slice::from_ref(&points),
        live: std::slice::from_ref(&points),
        truth: &points,
        map: &points,
        loops: &[[[f64::NAN, 0.0], [1.0, f64::INFINITY]]],
        apart: &[vec![points.clone()], Vec::new()],
    };
    let svg = plot_trajectories(&plot).unwrap();
    assert!(svg.contains("&lt;&amp;&gt;"));
}

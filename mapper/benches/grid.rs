//! `cargo bench -p randt-mapper --bench grid`: what the grid costs when a closure moves every
//! keyframe.
//!
//! Prints machine, data, median and p99.

mod shared;

use randt_geometry::Pose2;
use randt_mapper::occupancy::{Grid, GridKeyframe};
use randt_mapper::{LazyObservation, Observation};
use randt_messages::{KeyframeBeam, KeyframePoint};
use shared::{machine, milliseconds, print};
use std::f64::consts::TAU;
use std::time::Instant;

/// Keyframes of the map: half a kilometre.
const KEYFRAMES: u64 = 1000;
/// Beams of an iSDR-C.
const BEAMS: u32 = 220;
/// Range of every return, m: indoors the farthest, and so the dearest.
const RANGE_M: f64 = 12.0;
/// Returns of a beam, a range bin apart.
const RETURNS: u32 = 7;
const BIN_M: f64 = 0.0161;
/// Closures.
const RUNS: usize = 100;
/// The longest that it may take; more and the map lags behind the loop that made it, ms.
const ALLOWED_MS: f64 = 200.0;

fn main() {
    println!("machine: {}", machine());
    let observation = LazyObservation::from(keyframe());
    // Around a block of 40 m, again and again.
    let pose = |id: u64| {
        let angle = id as f64 * 0.02;
        let (sin, cos) = randt_geometry::elementary::sin_cos(angle);
        Pose2::new(20.0 * cos, 20.0 * sin, angle + 0.25 * TAU)
    };
    let keyframes = |correction: Pose2| {
        let observation = &observation;
        let keyframe = |id| GridKeyframe {
            id,
            map_from_base: correction.compose(&pose(id)),
            observation,
        };
        (0..KEYFRAMES).map(keyframe).collect::<Vec<_>>()
    };
    let mut grid = Grid::new(&randt_config::Grid::default());
    let begin = Instant::now();
    grid.update(&keyframes(Pose2::IDENTITY));
    let first = begin.elapsed();

    println!(
        "\n{KEYFRAMES} keyframes of {BEAMS} beams of {RANGE_M} m, {} tiles",
        grid.tiles().count()
    );
    println!("all new      {:.1} ms", milliseconds(first));
    let mut times = Vec::new();
    for run in 0..RUNS {
        let shift = 0.5 * (run % 2 + 1) as f64;
        let begin = Instant::now();
        let update = grid.update(&keyframes(Pose2::new(shift, -0.3 * shift, 0.01 * shift)));
        times.push(begin.elapsed());
        assert_eq!(update.moved as u64, KEYFRAMES);
    }
    print("all moved", times, Some(ALLOWED_MS));

    let correction = Pose2::new(0.001, 0.0, 0.0);
    grid.update(&keyframes(Pose2::IDENTITY));
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let begin = Instant::now();
        grid.update(&keyframes(correction));
        times.push(begin.elapsed());
    }
    print("none moved", times, None);
    let mut times = Vec::new();
    for id in 0..RUNS as u64 {
        let new = GridKeyframe {
            id: KEYFRAMES + id,
            map_from_base: pose(id),
            observation: &observation,
        };
        let begin = Instant::now();
        grid.update(&[new]);
        times.push(begin.elapsed());
    }
    print("one new", times, None);
}

/// Beams all around, each with a cluster at the same range.
fn keyframe() -> Observation {
    let (mut beams, mut points) = (Vec::new(), Vec::new());
    for beam in 0..BEAMS {
        let azimuth = f64::from(beam) / f64::from(BEAMS) * TAU;
        let (sin, cos) = randt_geometry::elementary::sin_cos(azimuth);
        beams.push(KeyframeBeam {
            x_m: 0.12,
            y_m: 0.0,
            azimuth_rad: azimuth as f32,
            first_point: points.len() as u32,
        });
        for n in 0..RETURNS {
            let range_m = RANGE_M + f64::from(n) * BIN_M;
            points.push(KeyframePoint {
                x_m: (0.12 + range_m * cos) as f32,
                y_m: (range_m * sin) as f32,
                intensity: (10 - n.abs_diff(RETURNS / 2)) as f32,
                beam: beam as u16,
                reserved: 0,
            });
        }
    }
    Observation { beams, points }
}

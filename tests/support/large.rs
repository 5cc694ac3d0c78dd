//! The journal of a map of thousands of keyframes, made in seconds: up and down a corridor, by a
//! robot that looks for no loops there, because those are what takes minutes (docs/pipeline.md).

use randt_config::{Config, Selection};
use randt_geometry::elementary::{PI, sin_cos};
use randt_mapper::Mapper;
use randt_mapper::journal::JournalFile;
use randt_messages::{Keyframe, KeyframeBeam, KeyframePoint, Message};
use std::path::Path;

pub const KEYFRAMES: u64 = 5000;
/// With this key set no place of one frame is old enough to be met again.
pub const SET: &str = "loops.path_min_m=1000000";
/// Between two keyframes, and in one direction, m.
const STEP_M: f64 = 0.5;
const CORRIDOR_M: f64 = 100.0;
/// Of an iSDR-C indoors: 1,200 returns, 8 kB in the journal.
const BEAMS: u32 = 240;
const RETURNS: u32 = 5;

/// Writes it, as a mapper with a robot's configuration does.
pub fn write(robot: &Path, journal: &Path) {
    let selection = Selection {
        robot: Some(robot.display().to_string()),
        set: vec![SET.to_owned()],
        ..Selection::default()
    };
    let config = Config::load(&selection).unwrap().config;
    let mut opened = JournalFile::open(journal, &config).unwrap();
    let mut mapper = Mapper::new(&config);
    let mut keyframe = Message::<Keyframe>::default();
    for id in 0..KEYFRAMES {
        fill(id, &mut keyframe);
        opened.journal.append_keyframe(keyframe.as_ref()).unwrap();
        assert!(mapper.push(keyframe.as_ref()));
        if opened.journal.is_snapshot_due(&mapper) {
            opened.journal.append_snapshot(&mapper).unwrap();
        }
    }
    opened.journal.sync().unwrap();
}

fn fill(id: u64, keyframe: &mut Message<Keyframe>) {
    let head = &mut *keyframe.head;
    head.id = id;
    head.header.stamp_ns = 200_000_000 * (id as i64 + 1);
    let path_m = STEP_M * id as f64;
    let along_m = path_m % (2.0 * CORRIDOR_M);
    head.pose = match along_m < CORRIDOR_M {
        true => [along_m, 0.0, 0.0],
        false => [2.0 * CORRIDOR_M - along_m, 0.0, PI],
    };
    head.submap_root = id - id % 8;
    for n in [0, 4, 8] {
        head.covariance[n] = 1e-4;
    }
    head.beam_count = BEAMS;
    keyframe.items.clear();
    for beam in 0..BEAMS {
        let azimuth_rad = 2.0 * PI * f64::from(beam) / f64::from(BEAMS);
        let (sin, cos) = sin_cos(azimuth_rad);
        head.beams[beam as usize] = KeyframeBeam {
            x_m: 0.12,
            y_m: 0.0,
            azimuth_rad: azimuth_rad as f32,
            first_point: keyframe.items.len() as u32,
        };
        // Walls 4 m to the left and right, rough by a bin or two.
        let rough_m = f64::from((beam.wrapping_mul(2_654_435_761) ^ id as u32) % 7) * 0.02;
        let range_m = (4.0 / sin.abs().max(0.4)) + rough_m;
        keyframe.items.extend((0..RETURNS).map(|n| {
            let range_m = range_m + 0.04 * f64::from(n);
            KeyframePoint {
                x_m: (range_m * cos) as f32,
                y_m: (range_m * sin) as f32,
                intensity: 20.0 - (n.abs_diff(2) as f32),
                beam: beam as u16,
                reserved: 0,
            }
        }));
    }
}

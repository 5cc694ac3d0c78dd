//! Our sweeps against those of the recording room.bag: returns, filtered returns, beam width,
//! intensities.

use randt_config::{Filter, Sensor};
use randt_filter::ClusterFilter;
use randt_messages::{Message, RadarPoints, RadarScan};
use randt_simulator::{Event, Robot, Simulation, World};
use std::path::PathBuf;

/// Bin width, beams and bins of an iSDR-C.
const BIN_M: f64 = 0.0161;
const BEAMS: usize = 220;
const BINS: usize = 995;
/// Bins from 0.6 to 12 m, where neither the radome nor the far noise counts.
const NEAR: usize = 38;
const FAR: usize = 745;

/// What is compared.
#[derive(Clone, Copy, Debug)]
struct Statistics {
    /// Returns a sweep.
    returns: f64,
    /// Returns a sweep after the cluster filter, indoor profile (0.6 to 12 m).
    filtered: f64,
    /// Beams, mean: around each echo of 25 dB or more that is strongest among its neighbours in
    /// beam and range, the adjacent beams whose return in the same range bin is at most 10 dB
    /// weaker, itself included. It holds the antenna pattern and how walls stand to the beam.
    beam_width: f64,
    /// Returns a sweep behind 0.6 m with more than 10 dB: echoes, not noise.
    strong: f64,
    /// Median and 90th percentile of the intensity behind 0.6 m, dB.
    median_db: f64,
    upper_db: f64,
}

/// Measured on the 200 sweeps of room.bag by the function below.
const ROOM: Statistics = Statistics {
    returns: 10_598.0,
    filtered: 2_179.0,
    beam_width: 5.34,
    strong: 2_061.0,
    median_db: 7.4,
    upper_db: 21.2,
};

fn measure(scans: impl Iterator<Item = Message<RadarScan>>) -> Statistics {
    let filter = Filter { range_max_m: 12.0 };
    let mut filter = ClusterFilter::new(&filter, &Sensor::default());
    let mut points = Message::<RadarPoints>::default();
    let (mut sweeps, mut returns, mut filtered, mut strong) = (0.0, 0.0, 0.0, 0.0);
    let (mut width, mut peaks) = (0.0, 0.0);
    let mut intensities = Vec::new();
    for scan in scans {
        sweeps += 1.0;
        returns += scan.items.len() as f64;
        filter.process(scan.as_ref(), &mut points);
        filtered += points.items.len() as f64;
        let mut grid = vec![[0.0_f32; BINS]; BEAMS];
        for (index, beam) in scan.head.sweep.beams().iter().enumerate() {
            let turn = (f64::from(beam.azimuth_rad) + std::f64::consts::PI) / std::f64::consts::TAU;
            let row = (turn * BEAMS as f64).round() as usize % BEAMS;
            for item in &scan.items[scan.head.sweep.returns_of(index, scan.items.len())] {
                let bin = ((f64::from(item.range_m) / BIN_M).round() as usize).min(BINS - 1);
                grid[row][bin] = item.intensity;
                if bin >= NEAR {
                    intensities.push(item.intensity);
                    strong += f64::from(u8::from(item.intensity > 10.0));
                }
            }
        }
        for row in 0..BEAMS {
            for bin in NEAR..FAR {
                let peak = grid[row][bin];
                let (left, right) = (
                    grid[(row + BEAMS - 1) % BEAMS][bin],
                    grid[(row + 1) % BEAMS][bin],
                );
                let beside = grid[row][bin - 1].max(grid[row][bin + 1]);
                if peak < 25.0 || peak < left || peak < right || peak < beside {
                    continue;
                }
                let run = |step: usize| {
                    (1..30)
                        .take_while(|n| grid[(row + n * step) % BEAMS][bin] > peak - 10.0)
                        .count()
                };
                width += (1 + run(1) + run(BEAMS - 1)) as f64;
                peaks += 1.0;
            }
        }
    }
    intensities.sort_by(f32::total_cmp);
    let percentile =
        |share: f64| f64::from(intensities[(intensities.len() as f64 * share) as usize]);
    Statistics {
        returns: returns / sweeps,
        filtered: filtered / sweeps,
        beam_width: width / peaks,
        strong: strong / sweeps,
        median_db: percentile(0.5),
        upper_db: percentile(0.9),
    }
}

fn assert_near(found: Statistics, wanted: Statistics, share: f64) {
    println!("found {found:.2?}\nwanted {wanted:.2?}");
    for (name, found, wanted) in [
        ("returns", found.returns, wanted.returns),
        ("filtered returns", found.filtered, wanted.filtered),
        ("beam width", found.beam_width, wanted.beam_width),
        ("strong returns", found.strong, wanted.strong),
        ("median intensity", found.median_db, wanted.median_db),
        ("upper intensity", found.upper_db, wanted.upper_db),
    ] {
        assert!(
            (found / wanted - 1.0).abs() < share,
            "{name}: {found:.2}, expected {wanted:.2}"
        );
    }
}

#[test]
fn simulated_sweeps_are_like_those_of_the_room() {
    for seed in [1, 2] {
        let scans = Simulation::new(&World::building(), Robot::default(), 300, seed);
        let scans = scans.filter_map(|event| match event {
            Event::Scan(scan) => Some(scan),
            _ => None,
        });
        assert_near(measure(scans), ROOM, 0.3);
    }
}

#[test]
fn the_figures_of_the_room_are_those_of_the_recording() {
    let folder = std::env::var_os("RANDT_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = folder.join("bags/room.bag");
    if !path.exists() {
        assert!(
            std::env::var_os("CI").is_none(),
            "no data at {}",
            path.display()
        );
        println!("skipped: no data");
        return;
    }
    let mut source = randt_readers::open(&path, &Default::default()).unwrap();
    let scans = std::iter::from_fn(|| {
        loop {
            match source.next_event().unwrap()? {
                Event::Scan(scan) => return Some(scan),
                _ => continue,
            }
        }
    });
    assert_near(measure(scans), ROOM, 0.03);
}

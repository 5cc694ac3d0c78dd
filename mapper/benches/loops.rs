//! `cargo bench -p randt-mapper --bench loops`: what a loop costs among a thousand keyframes, and
//! what they weigh.
//!
//! Prints machine, data, median and p99. The keyframes are odometry's on a simulated drive through
//! the building.
#![allow(
    clippy::unwrap_used,
    reason = "a benchmark says by panicking what is wrong"
)]

mod shared;

use randt_drives::{Drive, config};
use randt_geometry::Pose2;
use randt_mapper::{Mapper, PlaceRecognition, QuerySubmap, Registrar, Submaps};
use randt_simulator::World;
use shared::{machine, print};
use std::fs;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Keyframes of the map.
const KEYFRAMES: usize = 1000;
/// Sweeps that make that many: three laps and a little.
const SCANS: u64 = 4600;
/// Searches that are timed.
const SEARCHES: usize = 500;
/// How far a refinement starts from its end: what the estimate is off when a lap of 155 m closes,
/// m and rad.
const OFF: [f64; 3] = [0.3, -0.2, 0.03];
/// Limits: ms, ms, MB.
const SEARCH_MAX_MS: f64 = 0.5;
const REFINEMENT_MAX_MS: f64 = 3.0;
const MEMORY_MAX_MB: f64 = 100.0;

fn main() {
    println!("machine: {}", machine());
    let world = World::building();
    let mut drive = Drive::new(&world, SCANS, 1, &[]);
    drive.keyframes.truncate(KEYFRAMES);
    let config = config(&world);

    let before_mb = resident_mb();
    let mut mapper = Mapper::new(&config);
    let mut pushes = Vec::new();
    for keyframe in &drive.keyframes {
        let begin = Instant::now();
        mapper.push(keyframe.as_ref());
        pushes.push(begin.elapsed());
    }
    mapper.update_grid();
    let memory_mb = resident_mb() - before_mb;
    println!(
        "\nbuilding, {} keyframes of {} points, {} loops",
        mapper.keyframes().len(),
        drive.keyframes.iter().map(|k| k.items.len()).sum::<usize>() / KEYFRAMES,
        mapper.accepted().count(),
    );
    print("keyframe, all of the mapper but the grid", pushes, None);
    println!("memory, grid included    {memory_mb:.0} MB (at most {MEMORY_MAX_MB:.0})");

    let keyframes = mapper.keyframes();
    let mut search = PlaceRecognition::new(&config);
    keyframes.iter().for_each(|keyframe| search.push(keyframe));
    let searches =
        (0..SEARCHES).map(|_| time(|| search.by_appearance(keyframes, |_| true, |_| None)));
    print(
        "ScanContext search",
        searches.collect(),
        Some(SEARCH_MAX_MS),
    );

    let mut submaps = Submaps::new(&config);
    for end in 1..=keyframes.len() {
        submaps.push(&keyframes[..end]);
    }
    let (mut query, mut registrar) = (QuerySubmap::new(&config), Registrar::new(&config));
    let mut refinements = Vec::new();
    for found in mapper.accepted() {
        query.build(&keyframes[..=found.newer.0]);
        let grid = submaps.grid(found.older, keyframes).unwrap();
        let start = found.older_from_newer.compose(&Pose2::from_array(OFF));
        refinements.push(time(|| registrar.register(grid, &query, &start)));
    }
    print("loop refinement", refinements, Some(REFINEMENT_MAX_MS));
    let queries = (0..keyframes.len()).map(|i| time(|| query.build(&keyframes[..=i])));
    print("query submap, once a search", queries.collect(), None);
}

fn time<T>(work: impl FnOnce() -> T) -> Duration {
    let begin = Instant::now();
    black_box(work());
    begin.elapsed()
}

/// Resident memory of this process, MB.
fn resident_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kb = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kb.unwrap_or(f64::NAN) / 1024.0
}

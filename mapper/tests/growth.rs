//! Laps of one hall: known ground costs few edges, few factorisations, and no nodes.

use crate::laps::Laps;
use randt_config::Config;
use randt_counting_allocator::allocated_bytes;
use randt_drives::{Drive, config};
use randt_geometry::Pose2;
use randt_geometry::elementary::{atan2, sin_cos};
use randt_mapper::journal::JournalFile;
use randt_mapper::publication::fill_graph;
use randt_mapper::{KeyframeIdx, MapKeyframe, Mapper};
use randt_messages::{MapperGraph, Message};
use randt_simulator::World;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::sync::LazyLock;
use std::time::Duration;
use tempfile::TempDir;

/// 14 x 9 m of rooms and furniture, a lap of 29 m again and again.
pub const HALL: &str = "\
wall concrete 0,0 14,0 14,9 0,9 0,0 doors 4..5
wall plaster 7,0 7,3.4
wall plaster 7,5.6 7,9
block metal 2.4,6.6 1.2x0.8
block wood 10,1 1.4x0.6
block wood 12.2,6.5 0.8x1.5
post metal 4.2,1.4 0.15
speed 0.8
route 2,2 5,2.2 7,4.5 10,3 12,3 12,5.5 10,6.5 7,4.5 5,6.2 2,5
";

/// The length of a world's route, m.
pub fn lap_m(world: &World) -> f64 {
    let next = world.route_m.iter().cycle().skip(1);
    let legs = world.route_m.iter().zip(next);
    legs.map(|(a, b)| (b - a).norm()).sum()
}

/// Processor time that this thread has used.
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|time| time.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

/// What a stretch of keyframes cost.
#[derive(Default)]
struct Stretch {
    keyframes: usize,
    total: Duration,
    slowest: Duration,
}

/// Five laps of the hall.
pub static FIVE_LAPS: LazyLock<Drive> = LazyLock::new(|| Drive::new(&hall(), 1600, 1, &[]));

pub fn hall() -> World {
    World::parse("hall", HALL).unwrap()
}

/// The configuration for the hall by which a place keeps its first laps, 0: all.
fn hall_config(laps_max: u32) -> Config {
    let mut config = config(&hall());
    config.loops.laps_max = laps_max;
    config
}

/// The configuration for the hall by which all but the first lap leaves the graph.
pub fn first_lap_only() -> Config {
    hall_config(1)
}

/// Keyframes that are nodes of the graph.
fn nodes(mapper: &Mapper) -> usize {
    let keyframes = (0..mapper.keyframes().len()).map(KeyframeIdx);
    keyframes
        .filter(|keyframe| mapper.is_node(*keyframe))
        .count()
}

/// Keyframes of which the map has what they saw.
fn remembered(mapper: &Mapper) -> usize {
    let saw = |keyframe: &&MapKeyframe| !keyframe.observation.points.is_empty();
    mapper.keyframes().iter().filter(saw).count()
}

/// A journal as the process writes it, but that it waits for its compactions.
struct Written {
    folder: TempDir,
    journal: JournalFile,
}

impl Written {
    fn new(config: &Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let opened = JournalFile::open(folder.path().join("map.journal"), config).unwrap();
        Self {
            folder,
            journal: opened.journal,
        }
    }

    /// The mapper has taken the newest keyframe.
    fn follow(&mut self, mapper: &Mapper) {
        let journal = &mut self.journal;
        if journal.is_snapshot_due(mapper) {
            journal.append_snapshot(mapper).unwrap();
        }
        if journal.is_compaction_due(mapper) {
            let compaction = journal.begin_compaction(mapper).unwrap();
            journal
                .finish_compaction(compaction.run().unwrap())
                .unwrap();
        }
    }

    fn kib(&self) -> u64 {
        self.journal.length() / 1024
    }

    /// Time until a mapper is back with as many keyframes.
    fn restart(self, config: &Config, keyframes: usize) -> Duration {
        drop(self.journal);
        let before = processor_time();
        let opened = JournalFile::open(self.folder.path().join("map.journal"), config).unwrap();
        let recalled = Mapper::recall(config, opened.contents, None);
        let took = processor_time() - before;
        let back = recalled.mapper.keyframes().len() + recalled.to_replay.len();
        assert_eq!(back, keyframes);
        took
    }
}

/// Gives a mapper a drive and prints what each stretch of it cost.
fn push_all(
    config: &Config,
    drive: &Drive,
    stretch: usize,
    mut written: Option<&mut Written>,
) -> Mapper {
    // Of the whole process: it is the mapper's where no other test runs.
    let before_bytes = allocated_bytes();
    let mut mapper = Mapper::new(config);
    println!(
        "keyframes   ms each  slowest ms  factorised   nodes  remembered      KiB  journal KiB   loops   found  registered"
    );
    let mut cost = Stretch::default();
    for keyframe in &drive.keyframes {
        if let Some(written) = &mut written {
            let appended = written.journal.append_keyframe(keyframe.as_ref());
            appended.unwrap();
        }
        let before = processor_time();
        mapper.push(keyframe.as_ref());
        let took = processor_time() - before;
        if let Some(written) = &mut written {
            written.follow(&mapper);
        }
        cost.keyframes += 1;
        cost.total += took;
        cost.slowest = cost.slowest.max(took);
        if cost.keyframes == stretch {
            println!(
                "{:9} {:9.3} {:11.3} {:11} {:7} {:11} {:8} {:12} {:7} {:7} {:11}",
                mapper.keyframes().len(),
                cost.total.as_secs_f64() * 1e3 / stretch as f64,
                cost.slowest.as_secs_f64() * 1e3,
                mapper.counters().factorisations,
                nodes(&mapper),
                remembered(&mapper),
                allocated_bytes().saturating_sub(before_bytes) / 1024,
                written.as_ref().map_or(0, |it| it.kib()),
                mapper.graph_loops().len(),
                mapper.found().count(),
                mapper.closures().len(),
            );
            cost = Stretch::default();
        }
    }
    let before = processor_time();
    mapper.finish();
    println!("finish: {:.3} s", (processor_time() - before).as_secs_f64());
    println!("off by {:.4} m", off_m(&mapper, drive));
    mapper
}

/// Root mean square of the keyframes' distances from the truth, after the best rigid alignment, m.
fn off_m(mapper: &Mapper, drive: &Drive) -> f64 {
    root_mean(&squares_m2(mapper, drive))
}

/// The root of a mean of squares.
pub fn root_mean(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Squares of the keyframes' distances from the truth, after the best rigid alignment of all, m^2.
pub fn squares_m2(mapper: &Mapper, drive: &Drive) -> Vec<f64> {
    let truth = |keyframe: usize| drive.truth(mapper.keyframes()[keyframe].stamp_ns);
    let pairs: Vec<(Pose2, Pose2)> = mapper
        .poses()
        .iter()
        .enumerate()
        .map(|(index, pose)| (*pose, truth(index)))
        .collect();
    let count = pairs.len() as f64;
    let mean = |of: fn(&(Pose2, Pose2)) -> nalgebra::Vector2<f64>| {
        pairs.iter().map(of).sum::<nalgebra::Vector2<f64>>() / count
    };
    let (own, other) = (mean(|p| p.0.translation()), mean(|p| p.1.translation()));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (a, b) in &pairs {
        let (a, b) = (a.translation() - own, b.translation() - other);
        dot += a.dot(&b);
        cross += a.x * b.y - a.y * b.x;
    }
    let turn = Pose2::new(0.0, 0.0, atan2(cross, dot));
    let square = |(a, b): &(Pose2, Pose2)| {
        let a = turn.transform(a.translation() - own);
        (a - (b.translation() - other)).norm_squared()
    };
    pairs.iter().map(square).collect()
}

/// Five laps. What counts is counted, so that a busy machine changes nothing.
#[test]
fn known_ground_costs_few_edges_and_few_factorisations() {
    /// Keyframes that odometry may add until the equations are factorised anew.
    const TAIL_MAX: usize = 16;
    let mapper = push_all(&hall_config(0), &FIVE_LAPS, 50, None);
    let (keyframes, edges) = (mapper.keyframes().len(), mapper.accepted().count());
    let (found, factorisations) = (mapper.found().count(), mapper.counters().factorisations);
    println!("{keyframes} keyframes, {found} loops, {edges} of them edges");
    // Without the end of the drive, at which all loops are judged anew.
    let whole = 3 * edges + keyframes / TAIL_MAX + 20;
    assert!(
        factorisations as usize <= whole,
        "{factorisations} for {edges}"
    );
    assert!(found > keyframes && 3 * edges < found, "{edges} of {found}");
    // Measured 0.0095; 0.0085 with an edge for every loop (8,000 scans).
    assert!(off_m(&mapper, &FIVE_LAPS) < 0.02);
    assert_eq!(nodes(&mapper), keyframes);
}

/// Of a lap in known ground only what lies before the last metres stays.
#[test]
fn known_ground_costs_no_nodes() {
    let mapper = push_all(&first_lap_only(), &FIVE_LAPS, 50, None);
    // A lap has 57 keyframes; those of the last 25 m and of the first loops stay, too.
    let keyframes = mapper.keyframes().len();
    assert!(
        keyframes > 280 && nodes(&mapper) < 130,
        "{}",
        nodes(&mapper)
    );
    // What the others saw is forgotten, but for neighbours of nodes and for what is newest at its
    // place.
    let remembered = remembered(&mapper);
    println!("{remembered} of {keyframes} keyframes remembered");
    assert!(remembered < 220, "{remembered}");
    let every = (0..keyframes).map(KeyframeIdx);
    assert_eq!(every.filter(|it| mapper.remembers(*it)).count(), remembered);
    // Every keyframe has its place on the way, and its loops count though they are no edges.
    assert_eq!(mapper.poses().len(), keyframes);
    assert!(mapper.found().count() > 200 && mapper.accepted().count() < 60);
    assert!(off_m(&mapper, &FIVE_LAPS) < 0.025);
    let mut graph = Message::<MapperGraph>::default();
    fill_graph(&mapper, 0, &mut graph);
    let head = &graph.head;
    assert_eq!(head.loops as usize, mapper.accepted().count());
    let found = mapper.found().count();
    assert_eq!((head.loops + head.confirmed_loops) as usize, found);
}

/// Gives a mapper many laps and prints what each of them is like.
fn drive_laps(world: &World, scans: u64, stretch: usize) {
    let laps_max = std::env::var("LAPS_MAX").map_or(3, |laps| laps.parse().unwrap());
    let mut config = config(world);
    config.loops.laps_max = laps_max;
    let drive = Drive::new(world, scans, 1, &[]);
    let mut written = Written::new(&config);
    let mapper = push_all(&config, &drive, stretch, Some(&mut written));
    let restart = written.restart(&config, mapper.keyframes().len());
    println!("back in {restart:?}");
    assert!(restart < Duration::from_millis(500));
    let laps = Laps::new(&mapper, &drive, lap_m(world));
    laps.print();
    let (second, last) = (laps.lap(1).unwrap(), laps.last_whole().unwrap());
    assert!(last.off_m < second.off_m + 0.01, "{last:?} {second:?}");
    for lap in laps.whole().skip(1) {
        assert!(lap.false_loops == 0 && lap.recall() > 0.85, "{lap:?}");
    }
}

/// `cargo test -p randt-mapper --test integration growth -- --ignored --nocapture`
#[test]
#[ignore = "minutes: the long form"]
fn many_laps_of_a_hall() {
    let scans = std::env::var("SCANS").map_or(8000, |scans| scans.parse().unwrap());
    drive_laps(&hall(), scans, 200);
}

/// `LAPS` of a built-in world.
fn laps_of(name: &str) {
    let world = World::named(name).unwrap();
    let laps = std::env::var("LAPS").map_or(12, |laps| laps.parse().unwrap());
    drive_laps(&world, laps * world.sweeps() / 2, 400);
}

#[test]
#[ignore = "minutes: the long form"]
fn many_laps_of_the_building() {
    laps_of("building");
}

#[test]
#[ignore = "minutes: the long form"]
fn many_laps_of_the_yard() {
    laps_of("yard");
}

/// A road round a park, 534 m, with posts every 8 m and nothing else: what a keyframe costs where
/// little is seen. `SCANS` sweeps, at 2 m/s.
#[test]
#[ignore = "minutes: the long form"]
fn many_laps_of_a_sparse_ring() {
    const RADIUS_M: f64 = 85.0;
    let at = |radius_m: f64, share: f64| {
        let (sin, cos) = sin_cos(TAU * share);
        [radius_m * cos, radius_m * sin]
    };
    let mut text = String::from("speed 2\n");
    for post in 0..66 {
        let side_m = if post % 2 == 0 { 4.0 } else { -5.0 };
        let [x, y] = at(RADIUS_M + side_m, f64::from(post) / 66.0);
        writeln!(text, "post metal {x:.2},{y:.2} 0.{}", 1 + post % 3).unwrap();
    }
    text.push_str("route");
    for point in 0..90 {
        let [x, y] = at(RADIUS_M, f64::from(point) / 90.0);
        write!(text, " {x:.2},{y:.2}").unwrap();
    }
    let world = World::parse("ring", &text).unwrap();
    let scans = std::env::var("SCANS").map_or(8000, |scans| scans.parse().unwrap());
    let (config, drive) = (config(&world), Drive::new(&world, scans, 1, &[]));
    push_all(&config, &drive, 500, Some(&mut Written::new(&config)));
}

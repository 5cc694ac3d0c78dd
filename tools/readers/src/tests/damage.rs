//! Cut and mutated inputs: never a panic, never an endless reading, and what is good is used.
//!
//! The short form of the fuzz targets: the same entries, seeded mutations.

use super::support::*;
use crate::fuzzing::messages;
use crate::ros::imu::RosImu;
use crate::ros::{Cloud, decode_transforms};
use crate::{Counter, Error, Event, Options, open};
use proptest::prelude::*;
use std::path::Path;

const SEED: u64 = 20_260_101;

/// Reads whatever can be read; gives sweeps and the reader's counters.
fn read(path: &Path) -> Result<(usize, Vec<Counter>), Error> {
    let options = Options {
        radar_required: false,
        ..Options::default()
    };
    let mut source = open(path, &options)?;
    let mut sweeps = 0;
    while let Some(event) = source.next_event()? {
        if let Event::Scan(scan) = event {
            assert!(scan.head.sweep.beams().len() <= randt_messages::MAX_BEAMS);
            assert!(
                scan.items
                    .iter()
                    .all(|r| r.range_m.is_finite() && r.intensity.is_finite())
            );
            sweeps += 1;
        }
    }
    Ok((sweeps, source.counters()))
}

/// One kind of damage to a file, accidental or deliberate.
pub(super) fn mutate(random: &mut Random, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(3) {
        let at = random.below(bytes.len());
        match random.below(6) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at.max(1)),
            3 => bytes
                .iter_mut()
                .skip(at)
                .take(4)
                .for_each(|byte| *byte = 0xff),
            4 => bytes
                .iter_mut()
                .skip(at)
                .take(random.below(600))
                .for_each(|byte| *byte = 0),
            _ => {
                let junk: Vec<u8> = (0..random.below(40)).map(|_| random.next() as u8).collect();
                bytes.splice(at..at, junk);
            }
        }
    }
    bytes
}

/// A recording of 12 sweeps, two of them in each chunk.
fn bag(compression: &str) -> Vec<u8> {
    let messages = recording(Style::Ros1, &CloudLayout::AS_PUBLISHED, 12);
    ros1_bag(&messages, compression, 103)
}

fn mcap() -> Vec<u8> {
    mcap_bag(
        &recording(Style::CdrLittle, &CloudLayout::AS_PUBLISHED, 12),
        40_000,
    )
}

fn log() -> Vec<u8> {
    let (_folder, path) = file("a.bag", &bag("lz4"));
    let (events, source) = read_all(&path);
    log_of(&events, source.info())
}

#[test]
fn a_bag_cut_anywhere_gives_all_before_the_cut() {
    for (number, compression) in ["none", "lz4", "bz2"].into_iter().enumerate() {
        let whole = bag(compression);
        let (_folder, path) = file("whole.bag", &whole);
        let expected = fingerprint(&read_all(&path).0);
        let mut random = Random(SEED + number as u64);
        for _ in 0..100 {
            let cut = 13 + random.below(whole.len() - 13);
            std::fs::write(&path, &whole[..cut]).unwrap();
            let (sweeps, counters) = read(&path).unwrap();
            // Chunks are of about one size; one may be lost, and the index behind them needs none.
            let share = cut as f64 / whole.len() as f64;
            assert!(
                sweeps as f64 + 4.0 > 12.0 * share,
                "{compression} cut at {cut}: {sweeps}"
            );
            assert!(
                sweeps == 12 || counters.iter().any(|c| c.loss),
                "{cut}: {counters:?}"
            );
            assert!(!counters.is_empty(), "cut at {cut} unnoticed");
            if sweeps >= 8 {
                // The turn was learned from the same sweeps: the same bits up to the cut.
                let events = fingerprint(&read_all(&path).0);
                let same = events.iter().zip(&expected).take(350).all(|(a, b)| a == b);
                assert!(same, "{compression} cut at {cut}");
            }
        }
    }
}

#[test]
fn a_damaged_byte_in_a_bag_costs_one_chunk_at_most() {
    for (number, compression) in ["none", "lz4", "bz2"].into_iter().enumerate() {
        let whole = bag(compression);
        let mut random = Random(SEED + 10 + number as u64);
        let (_folder, path) = file("damaged.bag", &whole);
        for trial in 0..150 {
            let at = 13 + random.below(whole.len() - 13);
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << random.below(8);
            std::fs::write(&path, &damaged).unwrap();
            let (sweeps, counters) = read(&path).unwrap();
            assert!(
                sweeps >= 9,
                "trial {trial}, {compression} at {at}: {sweeps} {counters:?}"
            );
        }
    }
}

#[test]
fn reading_goes_on_behind_a_damaged_chunk_and_names_the_offset() {
    let mut bytes = bag("lz4");
    let chunk = bytes
        .windows(4)
        .position(|w| w == [0x04, 0x22, 0x4d, 0x18])
        .unwrap();
    bytes[chunk + 40..chunk + 400].fill(0);
    let (_folder, path) = file("damaged.bag", &bytes);
    let (sweeps, counters) = read(&path).unwrap();
    assert!(sweeps >= 10, "{sweeps}");
    let damage = counters.iter().find(|c| c.name == "bag_damaged").unwrap();
    assert!(damage.loss && damage.count == 1);
    assert!(
        damage.first.contains("damaged.bag: at byte "),
        "{}",
        damage.first
    );
    assert!(
        damage.first.contains("goes on with the chunk at byte "),
        "{}",
        damage.first
    );
}

#[test]
fn mutated_bags_logs_and_databases_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("seed.db3");
    database_bag(
        &recording(Style::CdrLittle, &CloudLayout::AS_PUBLISHED, 12),
        &database,
    );
    let seeds = [
        bag("none"),
        bag("lz4"),
        bag("bz2"),
        mcap(),
        log(),
        std::fs::read(&database).unwrap(),
    ];
    let path = folder.path().join("mutated");
    let mut random = Random(SEED + 20);
    for (number, seed) in seeds.iter().enumerate() {
        let (mut refused, mut sweeps) = (0, 0);
        for _ in 0..200 {
            std::fs::write(&path, mutate(&mut random, seed)).unwrap();
            match read(&path) {
                Ok((read, _)) => sweeps += read,
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().contains("mutated"), "{error}");
                }
            }
        }
        println!(
            "seed {SEED}, input {number}: {refused} of 200 refused, {sweeps} of 2400 sweeps read"
        );
        assert!(sweeps > 1000, "input {number}: {sweeps}");
    }
}

#[test]
fn cut_logs_give_all_before_the_cut() {
    for whole in [mcap(), log()] {
        let mut random = Random(SEED + 30);
        let (_folder, path) = file("cut.mcap", &whole);
        for _ in 0..100 {
            let cut = 200 + random.below(whole.len() - 200);
            std::fs::write(&path, &whole[..cut]).unwrap();
            let share = cut as f64 / whole.len() as f64;
            let (sweeps, counters) = read(&path).unwrap();
            assert!(sweeps as f64 + 4.0 > 12.0 * share, "cut at {cut}: {sweeps}");
            // Behind the last chunk is only the summary, which the reading does without.
            let counted = counters.iter().any(|c| c.name == "log_cut");
            assert!(
                counted || sweeps == 12,
                "cut at {cut}: {sweeps} {counters:?}"
            );
        }
    }
}

#[test]
fn mutated_images_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.png");
    super::oxford::image(&path, &super::oxford::sweep_rows(1_000_000));
    let seed = std::fs::read(&path).unwrap();
    let mut random = Random(SEED + 40);
    for _ in 0..500 {
        std::fs::write(&path, mutate(&mut random, &seed)).unwrap();
        let _ = read(folder.path());
    }
}

#[test]
fn mutated_messages_never_panic() {
    let mut random = Random(SEED + 50);
    let layout = CloudLayout {
        rows: 2,
        ..CloudLayout::AS_PUBLISHED
    };
    for style in [Style::Ros1, Style::CdrLittle, Style::CdrBig] {
        let seeds = [
            TestCloud {
                stamp_ns: 1,
                points: vec![(1.0, 2.0, 3.0); 4],
            }
            .serialise(style, &layout),
            imu(style, 1, [0.0; 3], [0.0; 3]),
            transforms(style, &[MOUNT_RADAR]),
        ];
        for seed in seeds {
            (0..2000).for_each(|_| messages(&mutate(&mut random, &seed)));
        }
    }
}

proptest! {
    #[test]
    fn any_bytes_decode_to_something_or_to_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        messages(&bytes);
    }

    /// A cloud survives every layout, in every serialisation.
    #[test]
    fn clouds_survive(
        points in prop::collection::vec((-100.0_f32..100.0, -100.0_f32..100.0, 0.0_f32..50.0), 0..40),
        style in prop::sample::select(vec![Style::Ros1, Style::CdrLittle, Style::CdrBig]),
        big_endian in any::<bool>(),
        double in any::<bool>(),
        extra in 0_usize..20,
        order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
        rows in 1_usize..3,
        row_padding in 0_usize..9,
    ) {
        let size = if double { 8 } else { 4 };
        let layout = CloudLayout {
            point_step: 4 * size + extra,
            offsets: order.map(|index| index * size + extra / 2),
            big_endian,
            datatype: if double { 8 } else { 7 },
            row_padding,
            rows,
            intensity_name: "intensities",
            values: 1,
        };
        let points: Vec<_> = points.into_iter().map(|(x, y, i)| (x.into(), y.into(), i.into())).collect();
        let cloud = TestCloud { stamp_ns: 1_700_000_000_123_456_789, points };
        let read = Cloud::decode(&cloud.serialise(style, &layout), style.encoding(), None).unwrap();
        prop_assert_eq!(read.header.stamp_ns, cloud.stamp_ns);
        prop_assert_eq!(read.header.frame, "left_radar_link");
        let read: Vec<_> = read.points.iter().map(|p| (p.x_m, p.y_m, f64::from(p.intensity))).collect();
        prop_assert_eq!(read, cloud.points);
    }

    #[test]
    fn samples_and_transforms_survive(
        rate in prop::array::uniform3(-10.0..10.0),
        acceleration in prop::array::uniform3(-20.0..20.0),
        style in prop::sample::select(vec![Style::Ros1, Style::CdrLittle, Style::CdrBig]),
    ) {
        let sample = RosImu::decode(&imu(style, 5_000_000_007, rate, acceleration), style.encoding()).unwrap();
        prop_assert_eq!((sample.rate_rad_s, sample.acceleration_m_s2), (rate, acceleration));
        prop_assert_eq!((sample.header.stamp_ns, sample.header.frame.as_str()), (5_000_000_007, "imu_link"));
        let both = [("map", "odom", rate, [0.0, 0.0, 0.0, 1.0]), MOUNT_IMU];
        let read = decode_transforms(&transforms(style, &both), style.encoding()).unwrap();
        prop_assert_eq!(read.len(), 2);
        prop_assert_eq!((read[0].parent.as_str(), read[0].translation_m), ("map", rate));
        prop_assert_eq!(read[1].rotation.to_array(), [0.0, 1.0, 0.0, 0.0]);
    }
}

#[test]
fn values_that_are_not_finite_are_left_out_and_counted() {
    let layout = CloudLayout::AS_PUBLISHED;
    let mut messages = recording(Style::Ros1, &layout, 9);
    let (bad, good) = (f64::NAN, [0.0; 3]);
    let points = vec![
        (1.0, 1.0, 9.0),
        (bad, 1.0, 9.0),
        (1.0, f64::INFINITY, 9.0),
        (1.0, 1.0, bad),
        (0.0, 0.0, 9.0),
    ];
    let end_ns = 1_700_000_002_000_000_000;
    let cloud = TestCloud {
        stamp_ns: end_ns,
        points,
    };
    messages.push(TestMessage {
        topic: "/radar/points",
        type_name: CLOUD,
        arrival_ns: end_ns,
        bytes: cloud.serialise(Style::Ros1, &layout),
    });
    messages.push(TestMessage {
        topic: "/imu/data",
        type_name: IMU,
        arrival_ns: end_ns,
        bytes: imu(Style::Ros1, end_ns, [bad, 0.0, 0.0], good),
    });
    // A message that ends too early.
    messages.push(TestMessage {
        topic: "/imu/data",
        type_name: IMU,
        arrival_ns: end_ns,
        bytes: vec![0; 30],
    });
    let (_folder, path) = file("a.bag", &ros1_bag(&messages, "none", 100));
    let (events, source) = read_all(&path);
    assert_eq!(events.len(), 9 * 51 + 1);
    let last = events.iter().rev().find_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        Event::Imu(_) | Event::Twist(_) | Event::Truth(_) => None,
    });
    assert_eq!(
        (
            last.unwrap().items.len(),
            last.unwrap().head.sweep.returns_dropped
        ),
        (1, 4)
    );
    let counted: Vec<_> = source
        .counters()
        .iter()
        .map(|c| (c.name, c.count, c.loss))
        .collect();
    for expected in [
        ("returns_not_finite", 3, false),
        ("returns_at_range_zero", 1, false),
        ("imu_samples_not_finite", 1, true),
        ("imu_samples_malformed", 1, true),
    ] {
        assert!(counted.contains(&expected), "{expected:?} in {counted:?}");
    }
}

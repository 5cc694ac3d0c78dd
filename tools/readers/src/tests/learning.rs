//! What is found from the points themselves: grid, start, sense of rotation, period, bins.

use super::support::*;
use crate::counters::Counters;
use crate::ros::Cloud;
use crate::sweep::{Polar, Turn};
use crate::{Counter, Options, Rotation, StampMeaning};
use core::f64::consts::{PI, TAU};
use randt_geometry::elementary::sin_cos;
use randt_messages::{MAX_BEAMS, MAX_RETURNS, Message, RadarScan};

const PERIOD_NS: i64 = 250_000_000;

/// Sweeps of a radar with `beams` beams from `start` on; each beam has a return with probability
/// `share`.
struct Radar {
    beams: u32,
    start_rad: f64,
    clockwise: bool,
    share: f64,
    jitter_rad: f64,
}

impl Radar {
    fn azimuth(&self, beam: u32) -> f64 {
        let turned = TAU * f64::from(beam) / f64::from(self.beams);
        self.start_rad + if self.clockwise { -turned } else { turned }
    }

    fn sweep(&self, number: i64, random: &mut Random) -> Polar {
        let mut polar = Cloud::default();
        polar.header.stamp_ns = number * PERIOD_NS;
        for beam in 0..self.beams {
            let azimuth = self.azimuth(beam) + self.jitter_rad * (random.unit() - 0.5);
            let (sin, cos) = sin_cos(azimuth);
            let mut bin = random.below(30) + 20;
            let count = if random.unit() < self.share {
                1 + random.below(4)
            } else {
                0
            };
            for _ in 0..count {
                let range = (bin as f64 + 0.5) * 0.05;
                polar.points.push(crate::ros::Point {
                    x_m: f64::from((range * cos) as f32),
                    y_m: f64::from((range * sin) as f32),
                    intensity: random.unit() as f32 + 1.0,
                });
                bin += 1 + random.below(3);
            }
        }
        Polar::from_cloud(&polar, false).0
    }

    fn sweeps(&self, count: i64) -> Vec<Polar> {
        let mut random = Random(7);
        (1..=count)
            .map(|number| self.sweep(number, &mut random))
            .collect()
    }
}

fn build(sweeps: &[Polar], options: &Options) -> (Turn, Vec<Message<RadarScan>>, Vec<Counter>) {
    let mut counters = Counters::default();
    let turn = Turn::learn(sweeps, options, &mut counters);
    let build = |(number, sweep): (u64, &Polar)| turn.build(sweep.clone(), number, &mut counters);
    let scans = (0..).zip(sweeps).map(build).collect();
    (turn, scans, counters.list())
}

/// Every beam stands where the radar had it, in azimuth and in time, with or without a return.
fn check(radar: &Radar, scans: &[Message<RadarScan>]) {
    for (number, scan) in scans.iter().enumerate() {
        let sweep = &scan.head.sweep;
        assert_eq!(sweep.beam_count, radar.beams);
        let begin_ns = number as i64 * PERIOD_NS;
        assert_eq!(
            (sweep.begin_ns, sweep.end_ns),
            (begin_ns, begin_ns + PERIOD_NS)
        );
        for (beam, found) in (0..).zip(sweep.beams()) {
            let apart = (f64::from(found.azimuth_rad) - radar.azimuth(beam)).rem_euclid(TAU);
            let apart = apart.min(TAU - apart);
            assert!(apart < 1e-5, "sweep {number} beam {beam}: {apart}");
            let expected_ns = begin_ns as f64
                + (f64::from(beam) + 0.5) / f64::from(radar.beams) * PERIOD_NS as f64;
            assert!(
                (found.stamp_ns as f64 - expected_ns).abs() < 2.0,
                "sweep {number} beam {beam}"
            );
        }
    }
}

#[test]
fn every_start_and_sense_is_found_from_the_order_of_the_points() {
    for (beams, start_rad) in [
        (220, -PI),
        (400, 0.014),
        (100, 2.0),
        (1000, -1.0),
        (12, 0.0),
    ] {
        for clockwise in [false, true] {
            for share in [1.0, 0.7] {
                let radar = Radar {
                    beams,
                    start_rad,
                    clockwise,
                    share,
                    jitter_rad: 0.0,
                };
                let (turn, scans, counters) = build(&radar.sweeps(20), &Options::default());
                assert_eq!(turn.clockwise, clockwise);
                check(&radar, &scans);
                assert!(counters.is_empty(), "{counters:?}");
                let resolution = scans[0].head.sweep.range_resolution_m;
                assert!((resolution - 0.05).abs() < 1e-5, "{resolution}");
                for item in scans.iter().flat_map(|scan| &scan.items) {
                    assert!(
                        (item.range_m - (f32::from(item.bin) + 0.5) * 0.05).abs() < 1e-3,
                        "{item:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn points_in_no_order_give_the_same_sweeps() {
    let radar = Radar {
        beams: 220,
        start_rad: -PI,
        clockwise: false,
        share: 0.9,
        jitter_rad: 0.0,
    };
    let sweeps = radar.sweeps(10);
    let mut random = Random(3);
    let mut shuffled = sweeps.clone();
    for sweep in &mut shuffled {
        for last in (1..sweep.points.len()).rev() {
            sweep.points.swap(last, random.below(last + 1));
        }
    }
    let (_, expected, _) = build(&sweeps, &Options::default());
    let (_, scans, counters) = build(&shuffled, &Options::default());
    for (scan, expected) in scans.iter().zip(&expected) {
        assert_eq!(scan.items, expected.items);
        assert_eq!(scan.head.sweep.beam_count, 220);
    }
    let names: Vec<_> = counters.iter().map(|c| (c.name, c.loss)).collect();
    assert_eq!(
        names,
        [("rotation_assumed", false), ("sweeps_sorted", false)]
    );
}

#[test]
fn one_sweep_out_of_order_is_sorted_by_the_others_order() {
    let radar = Radar {
        beams: 220,
        start_rad: -PI,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.0,
    };
    let mut sweeps = radar.sweeps(10);
    sweeps[5].points.reverse();
    let (_, scans, counters) = build(&sweeps, &Options::default());
    check(&radar, &scans);
    assert_eq!((counters[0].name, counters[0].count), ("sweeps_sorted", 1));
}

#[test]
fn a_turntable_that_does_not_stop_where_it_began_keeps_its_phase() {
    let mut random = Random(9);
    let mut radar = Radar {
        beams: 220,
        start_rad: 0.0,
        clockwise: false,
        share: 0.8,
        jitter_rad: 0.0,
    };
    let mut sweeps = Vec::new();
    for number in 1..=10 {
        radar.start_rad = -PI + 0.4 * TAU / 220.0 * (random.unit() - 0.5);
        sweeps.push(radar.sweep(number, &mut random));
    }
    let (_, scans, _) = build(&sweeps, &Options::default());
    for (scan, sweep) in scans.iter().zip(&sweeps) {
        assert_eq!(
            (scan.head.sweep.beam_count, scan.items.len()),
            (220, sweep.points.len())
        );
        for (item, point) in scan.items.iter().zip(&sweep.points) {
            let azimuth = scan.head.sweep.beams[usize::from(item.beam)].azimuth_rad;
            assert!((f64::from(azimuth) - point.azimuth_rad).abs() < 1e-5);
        }
    }
}

#[test]
fn beams_off_any_grid_are_taken_as_they_are() {
    let step = TAU / 150.0;
    let radar = Radar {
        beams: 150,
        start_rad: -PI + step,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.8 * step,
    };
    let sweeps = radar.sweeps(10);
    let (_, scans, _) = build(&sweeps, &Options::default());
    for (scan, sweep) in scans.iter().zip(&sweeps) {
        assert_eq!(scan.items.len(), sweep.points.len());
        assert!(scan.head.sweep.beam_count > 100);
        assert!(
            scan.head
                .sweep
                .beams()
                .is_sorted_by(|a, b| a.stamp_ns <= b.stamp_ns)
        );
    }
}

#[test]
fn empty_sweeps_single_beams_and_single_sweeps_have_a_table() {
    let radar = Radar {
        beams: 220,
        start_rad: -PI,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.0,
    };
    let mut sweeps = radar.sweeps(10);
    sweeps[3].points.clear();
    sweeps[4]
        .points
        .retain(|point| (point.azimuth_rad - 0.515).abs() < 0.014);
    let (_, scans, counters) = build(&sweeps, &Options::default());
    check(&radar, &scans);
    assert!(scans[3].items.is_empty() && scans[4].items.len() < 5 && !scans[4].items.is_empty());
    assert!(counters.is_empty(), "{counters:?}");

    let (_, scans, counters) = build(&sweeps[..1], &Options::default());
    assert_eq!(scans[0].head.sweep.beam_count, 220);
    assert_eq!(counters[0].name, "period_assumed");
    // A single beam.
    let (_, scans, _) = build(&sweeps[4..5], &Options::default());
    assert_eq!(scans[0].head.sweep.beam_count, 1);
    let (_, scans, _) = build(&sweeps[3..4], &Options::default());
    assert_eq!(scans[0].head.sweep.beam_count, 0);
}

#[test]
fn the_strongest_returns_are_kept_where_there_are_too_many() {
    let radar = Radar {
        beams: 400,
        start_rad: -PI,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.0,
    };
    let mut sweeps = radar.sweeps(2);
    let mut points = Vec::new();
    for point in &sweeps[1].points {
        for copy in 0..100 {
            points.push(crate::sweep::PolarPoint {
                intensity: point.intensity + copy as f32,
                ..*point
            });
        }
    }
    sweeps[1].points = points;
    let total = sweeps[1].points.len();
    let (_, scans, counters) = build(&sweeps, &Options::default());
    assert_eq!(scans[1].items.len(), MAX_RETURNS);
    assert_eq!(
        scans[1].head.sweep.returns_dropped as usize,
        total - MAX_RETURNS
    );
    assert!(scans[1].items.iter().all(|item| item.intensity > 30.0));
    assert!(
        counters
            .iter()
            .any(|c| c.name == "returns_over_limit" && c.loss)
    );
}

#[test]
fn a_cloud_of_a_lidar_falls_into_the_tables_sectors() {
    let radar = Radar {
        beams: 3000,
        start_rad: -PI,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.0,
    };
    let sweeps = radar.sweeps(3);
    let (_, scans, _) = build(&sweeps, &Options::default());
    assert!(scans[0].head.sweep.beam_count as usize <= MAX_BEAMS);
    assert_eq!(scans[0].items.len(), sweeps[0].points.len());
}

#[test]
fn stamp_period_and_rotation_can_be_set() {
    let radar = Radar {
        beams: 220,
        start_rad: -PI,
        clockwise: false,
        share: 1.0,
        jitter_rad: 0.0,
    };
    let sweeps = radar.sweeps(4);
    let options = |stamp, rotation| Options {
        stamp,
        rotation,
        period_s: Some(0.2),
        ..Options::default()
    };
    let (_, scans, _) = build(&sweeps, &options(StampMeaning::SweepBegin, Rotation::Auto));
    let sweep = &scans[0].head.sweep;
    assert_eq!(
        (sweep.begin_ns, sweep.end_ns),
        (PERIOD_NS, PERIOD_NS + 200_000_000)
    );
    let (_, scans, _) = build(
        &sweeps,
        &options(StampMeaning::SweepMiddle, Rotation::Clockwise),
    );
    let sweep = &scans[0].head.sweep;
    assert_eq!(
        (sweep.begin_ns, sweep.end_ns),
        (PERIOD_NS - 100_000_000, PERIOD_NS + 100_000_000)
    );
    assert!(sweep.beams()[1..].is_sorted_by(|a, b| a.azimuth_rad > b.azimuth_rad));
    assert!(sweep.beams().is_sorted_by(|a, b| a.stamp_ns < b.stamp_ns));
    assert_eq!(scans[0].items.len(), sweeps[0].points.len());
}

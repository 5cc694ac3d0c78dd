//! Folders in the form of Boreas, MulRan and RADIATE: the same turns of a radar from each.

use super::oxford::image;
use super::support::*;
use crate::{Error, Event, Options, open};
use randt_messages::{Message, RadarScan};
use std::path::Path;

pub(super) const START_NS: i64 = 1_700_000_000_000_000_000;
pub(super) const PERIOD_NS: i64 = 250_000_000;
pub(super) const AZIMUTHS: usize = 400;

/// The one bin of an azimuth that is strong.
fn strong(azimuth: usize) -> usize {
    50 + azimuth % 37
}

/// Powers of an azimuth.
pub(super) fn powers(azimuth: usize, bins: usize) -> Vec<u8> {
    (0..bins)
        .map(|bin| if bin == strong(azimuth) { 90 } else { 20 })
        .collect()
}

/// Middle of an azimuth in a turn, ns.
pub(super) fn time_ns(turn: i64, azimuth: usize) -> i64 {
    START_NS + turn * PERIOD_NS + (2 * azimuth as i64 + 1) * PERIOD_NS / (2 * AZIMUTHS as i64)
}

/// Rows as Oxford and Boreas have them; times in us or ns.
pub(super) fn rows(turn: i64, bins: usize, ns_per_tick: i64) -> Vec<Vec<u8>> {
    let row = |azimuth: usize| {
        let mut row = (time_ns(turn, azimuth) / ns_per_tick)
            .to_le_bytes()
            .to_vec();
        row.extend((azimuth as u16 * 14).to_le_bytes());
        row.push(255);
        row.extend(powers(azimuth, bins));
        row
    };
    (0..AZIMUTHS).map(row).collect()
}

/// Powers alone, one column an azimuth.
pub(super) fn columns(bins: usize) -> Vec<Vec<u8>> {
    let beams: Vec<Vec<u8>> = (0..AZIMUTHS).map(|azimuth| powers(azimuth, bins)).collect();
    (0..bins)
        .map(|bin| beams.iter().map(|beam| beam[bin]).collect())
        .collect()
}

pub(super) fn sweeps(events: &[Event]) -> Vec<&Message<RadarScan>> {
    super::bags::scans(events)
}

/// That each sweep has its one return of each beam where it should be.
pub(super) fn check(events: &[Event], bin_m: f64, name: &str) {
    let sweeps = sweeps(events);
    assert_eq!(sweeps.len(), 3, "{name}");
    for (turn, scan) in (0..).zip(sweeps) {
        let sweep = &scan.head.sweep;
        assert_eq!(
            (sweep.beam_count, sweep.beams_lost, scan.items.len()),
            (400, 0, 400),
            "{name}"
        );
        let end_ns = START_NS + (turn + 1) * PERIOD_NS;
        assert!(
            (sweep.end_ns - end_ns).abs() < 2_000_000,
            "{name}: {}",
            sweep.end_ns - end_ns
        );
        for (azimuth, (beam, item)) in sweep.beams().iter().zip(&scan.items).enumerate() {
            let range_m = (strong(azimuth) as f64 + 0.5) * bin_m;
            assert!((f64::from(item.range_m) - range_m).abs() < 1e-4, "{name}");
            let apart_ns = beam.stamp_ns - time_ns(turn, azimuth);
            assert!(apart_ns.abs() < 2_000_000, "{name}: {apart_ns}");
            let clockwise = -(azimuth as f64) * std::f64::consts::TAU / 400.0;
            let apart = (f64::from(beam.azimuth_rad) - clockwise).rem_euclid(std::f64::consts::TAU);
            assert!(
                apart.min(std::f64::consts::TAU - apart) < 1e-5,
                "{name}: beam {azimuth}"
            );
        }
    }
}

/// Samples of 100 Hz over the turns: stamp ns and the rate about z.
fn samples() -> impl Iterator<Item = (i64, f64)> {
    (0..80).map(|number| (START_NS + number * 10_000_000, 0.001 * number as f64))
}

/// That all samples are there, upright and in order.
fn check_imu(events: &[Event], name: &str) {
    let found = events.iter().filter_map(|event| match event {
        Event::Imu(sample) => Some(sample),
        _ => None,
    });
    let found: Vec<_> = found.collect();
    assert_eq!(found.len(), 80, "{name}");
    for (sample, (stamp_ns, rate)) in found.iter().zip(samples()) {
        assert!((sample.header.stamp_ns - stamp_ns).abs() < 1000, "{name}");
        assert!((sample.rate_rad_s[2] - rate).abs() < 1e-9, "{name}");
        assert_eq!(sample.acceleration_m_s2, [0.25, 0.0, 9.81], "{name}");
    }
    assert!(events.is_sorted_by_key(Event::stamp_ns), "{name}");
}

pub(super) fn write(path: &Path, text: impl AsRef<[u8]>) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

pub(super) fn write_image(path: &Path, rows: &[Vec<u8>]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image(path, rows);
}

#[test]
fn boreas_has_us_or_ns_and_its_imu() {
    for (ns_per_tick, bins, bin_m) in [(1000, 200, 0.04381), (1, 200, 0.04381)] {
        let folder = tempfile::tempdir().unwrap();
        for turn in 0..3 {
            let stamp = time_ns(turn, 0) / ns_per_tick;
            let path = folder.path().join(format!("radar/{stamp}.png"));
            write_image(&path, &rows(turn, bins, ns_per_tick));
        }
        let mut table = "GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n".to_owned();
        for (stamp_ns, rate) in samples() {
            let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
            table += &format!("{seconds}.{nanos:09},{rate},0,0,9.81,0,0.25\n");
        }
        write(&folder.path().join("applanix/imu_raw.csv"), table);
        let (events, source) = read_all(folder.path());
        assert_eq!(source.info().format, "boreas");
        assert!(source.counters().is_empty(), "{:?}", source.counters());
        check(&events, bin_m, "Boreas");
        check_imu(&events, "Boreas");
    }
}

#[test]
fn gravity_shows_an_imu_upside_down() {
    let folder = tempfile::tempdir().unwrap();
    write_image(
        &folder.path().join("radar/1700000000000000.png"),
        &rows(0, 100, 1000),
    );
    let line = "1700000000.1,0.1,0,0,-9.8,0,0\n1700000000.2,0.1,0,0,-9.8,0,0\n";
    write(&folder.path().join("applanix/imu.csv"), line);
    let (_, source) = read_with(
        folder.path(),
        &Options {
            bin_size_m: Some(0.05),
            ..Options::default()
        },
    );
    let turned = source
        .info()
        .extrinsics
        .imu
        .unwrap()
        .rotate([0.0, 0.0, -9.8].into());
    assert!((turned.z - 9.8).abs() < 1e-9);
}

#[test]
fn mulran_and_radiate_have_powers_alone() {
    let folder = tempfile::tempdir().unwrap();
    for turn in 0..3 {
        let stamp = START_NS + (turn + 1) * PERIOD_NS;
        let path = format!("sensor_data/radar/polar/{stamp}.png");
        write_image(&folder.path().join(path), &columns(3360));
    }
    let table: String = samples()
        .map(|(stamp_ns, rate)| format!("{stamp_ns},0,0,0,1,0,0,0,0,0,{rate},0.25,0,9.81,1,2,3\n"))
        .collect();
    write(&folder.path().join("sensor_data/xsens_imu.csv"), table);
    let (events, source) = read_all(folder.path());
    assert_eq!(source.info().format, "mulran");
    check(&events, 200.0 / 3360.0, "MulRan");
    check_imu(&events, "MulRan");

    let folder = tempfile::tempdir().unwrap();
    let frame = |number: usize, stamp_ns: i64| {
        let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        format!("Frame: {number:06} Time: {seconds}.{nanos:09}\n")
    };
    let mut list = String::new();
    for turn in 0..3 {
        let path = format!("Navtech_Polar/{:06}.png", turn + 1);
        write_image(&folder.path().join(path), &columns(576));
        list += &frame(turn + 1, START_NS + (turn as i64 + 1) * PERIOD_NS);
    }
    write(&folder.path().join("Navtech_Polar.txt"), list);
    let mut list = String::new();
    for (number, (stamp_ns, rate)) in samples().enumerate() {
        let text = format!("55.9 -3.2 10\n1 0 0\n0 1 0\n0 0 1\n0 0 0 1\n0 0 {rate}\n0.25 0 9.81\n");
        let path = format!("GPS_IMU_Twist/{:06}.txt", number + 1);
        write(&folder.path().join(path), text);
        list += &frame(number + 1, stamp_ns);
    }
    write(&folder.path().join("GPS_IMU_Twist.txt"), list);
    let (events, source) = read_all(folder.path());
    assert_eq!(source.info().format, "radiate");
    check(&events, 100.0 / 576.0, "RADIATE");
    check_imu(&events, "RADIATE");
}

#[test]
fn bins_that_fit_no_radar_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    write_image(
        &folder.path().join("radar/1700000000000000.png"),
        &rows(0, 150, 1000),
    );
    let mut source = open(folder.path(), &Options::default()).unwrap();
    assert_eq!(source.info().bin_size.unwrap().size_m, None);
    match source.next_event() {
        Err(error @ Error::BinSize { bins: 150, .. }) => {
            assert!(
                error.to_string().contains("sensor.range_resolution_m"),
                "{error}"
            );
        }
        other => panic!("{other:?}"),
    }
    let mut source = open(folder.path(), &Options::default()).unwrap();
    source.set_bin_size(0.1);
    assert!(matches!(source.next_event(), Ok(Some(Event::Scan(_)))));
}

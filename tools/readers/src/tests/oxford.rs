//! Oxford folders.

use super::support::*;
use crate::{Event, Options};
use randt_messages::{Message, RadarScan, SensorKind};
use std::path::Path;

fn scans(events: Vec<Event>) -> Vec<Message<RadarScan>> {
    let scans = events.into_iter().filter_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    scans.collect()
}

/// For images of 100 bins, which no known radar has.
fn options() -> Options {
    Options {
        bin_size_m: Some(0.0438),
        ..Options::default()
    }
}

/// Writes a grey image of these rows.
pub fn image(path: &Path, rows: &[Vec<u8>]) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, rows[0].len() as u32, rows.len() as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&rows.concat())
        .unwrap();
}

/// A row with one strong bin.
fn row(time_us: i64, encoder: u16, valid: bool, bin: usize) -> Vec<u8> {
    let mut row = time_us.to_le_bytes().to_vec();
    row.extend(encoder.to_le_bytes());
    row.push(if valid { 255 } else { 0 });
    row.extend((0..100).map(|at| if at == bin { 90 } else { 20 }));
    row
}

/// A sweep of 40 rows from encoder 5,000 over its zero, 1 ms a row, stamped in bursts of four.
pub fn sweep_rows(start_us: i64) -> Vec<Vec<u8>> {
    (0..40_u16)
        .map(|index| {
            let time = start_us + i64::from(index / 4 * 4) * 1000;
            row(time, (5000 + 140 * index) % 5600, true, usize::from(index))
        })
        .collect()
}

#[test]
fn the_recording_has_eleven_listed_scans_of_400_beams() {
    let Some(path) = data("radar/oxford") else {
        return;
    };
    let (events, source) = read_all(&path);
    assert_eq!(source.info().format, "oxford");
    assert!(
        source.counters().iter().all(|c| !c.loss),
        "{:?}",
        source.counters()
    );
    let scans = scans(events);
    assert_eq!((scans.len(), source.info().scans), (11, Some(11)));
    let mut previous_end: Option<i64> = None;
    for (index, scan) in scans.iter().enumerate() {
        let sweep = &scan.head.sweep;
        assert_eq!(scan.head.header.sequence, index as u64);
        assert_eq!(
            (sweep.sensor, sweep.beam_count),
            (SensorKind::NavtechCts as u32, 400)
        );
        assert!(
            (24_000..40_000).contains(&scan.items.len()),
            "{}",
            scan.items.len()
        );
        let turn_ns = sweep.end_ns - sweep.begin_ns;
        assert!((244_000_000..256_000_000).contains(&turn_ns), "{turn_ns}");
        // The fits of two sweeps meet within a third of the bursts.
        if let Some(end_ns) = previous_end {
            assert!((sweep.begin_ns - end_ns).abs() < 3_000_000);
        }
        previous_end = Some(sweep.end_ns);
        // Clockwise: azimuth falls from just below zero.
        assert!(sweep.beams()[0].azimuth_rad < 0.0 && sweep.beams()[0].azimuth_rad > -0.02);
        assert!(sweep.beams().is_sorted_by(|a, b| a.stamp_ns < b.stamp_ns));
        assert!(scan.items.iter().all(|r| r.intensity > 60.0));
    }
    let all = Options {
        unlisted_scans: true,
        power_min: 80.0,
        ..Options::default()
    };
    let (events, _) = read_with(&path, &all);
    assert_eq!(events.len(), 13);
    // The folder of the images, and one image, are inputs too.
    assert_eq!(read_all(&path.join("radar")).0.len(), 11);
    assert_eq!(
        read_all(&path.join("radar/1547131050856549.png")).0.len(),
        1
    );
}

#[test]
fn bursty_stamps_become_a_steady_turn_over_the_encoders_zero() {
    let folder = tempfile::tempdir().unwrap();
    image(&folder.path().join("1000000.png"), &sweep_rows(1_000_000));
    let scans = scans(read_with(folder.path(), &options()).0);
    let sweep = &scans[0].head.sweep;
    assert_eq!(
        (sweep.beam_count, sweep.beams_lost, scans[0].items.len()),
        (40, 0, 40)
    );
    let steps: Vec<i64> = sweep
        .beams()
        .windows(2)
        .map(|pair| pair[1].stamp_ns - pair[0].stamp_ns)
        .collect();
    assert!(
        steps.iter().all(|step| (step - 1_000_000).abs() < 10_000),
        "{steps:?}"
    );
    assert!((sweep.beams()[0].stamp_ns - 998_500_000).abs() < 200_000);
    for (beam, item) in sweep.beams().iter().zip(&scans[0].items) {
        let bin = usize::from(item.bin);
        assert!((item.range_m - (bin as f32 + 0.5) * 0.0438).abs() < 1e-5);
        assert_eq!((item.beam as usize, item.intensity), (bin, 90.0));
        let encoder = (5000 + 140 * bin) % 5600;
        let azimuth = -(encoder as f32) / 5600.0 * std::f32::consts::TAU;
        let apart = (beam.azimuth_rad - azimuth).rem_euclid(std::f32::consts::TAU);
        assert!(apart.min(std::f32::consts::TAU - apart) < 1e-5);
    }
}

#[test]
fn unmeasured_rows_are_counted_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = sweep_rows(1_000_000);
    rows[7][10] = 0;
    rows.remove(20);
    image(&folder.path().join("1.png"), &rows);
    let (events, source) = read_with(folder.path(), &options());
    assert_eq!(scans(events)[0].head.sweep.beams_lost, 2);
    assert!(
        source
            .counters()
            .iter()
            .any(|c| c.name == "beams_lost" && c.count == 2 && c.loss)
    );
}

#[test]
fn foreign_images_and_gaps_are_counted_and_stepped_over() {
    let folder = tempfile::tempdir().unwrap();
    let radar = folder.path().join("radar");
    std::fs::create_dir(&radar).unwrap();
    image(&radar.join("1000000.png"), &sweep_rows(1_000_000));
    image(&radar.join("1040000.png"), &vec![vec![7; 300]; 200]);
    std::fs::write(radar.join("1080000.png"), b"not an image").unwrap();
    image(&radar.join("1120000.png"), &vec![vec![255; 40]; 2000]);
    image(&radar.join("1200000.png"), &sweep_rows(1_200_000));
    let list = "1000000 1\n1040000 1\n1080000 1\n1120000 1\n1160000 1\n\n1200000 1\n";
    std::fs::write(folder.path().join("radar.timestamps"), list).unwrap();
    let (events, source) = read_with(folder.path(), &options());
    let scans = scans(events);
    assert_eq!(scans.len(), 2);
    assert_eq!(scans[1].head.header.sequence, 1);
    let count = |name| {
        source
            .counters()
            .into_iter()
            .find(|c| c.name == name)
            .unwrap()
    };
    assert_eq!(count("images_unreadable").count, 3);
    assert!(
        count("images_unreadable").first.contains("1040000.png: "),
        "{:?}",
        source.counters()
    );
    assert_eq!(count("scans_missing").count, 1);
    assert!(count("scans_missing").first.contains("line 5"));
}

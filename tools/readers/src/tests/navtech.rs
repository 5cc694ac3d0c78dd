//! What Navtech's ROS drivers publish: the same turns of a radar from each kind of message.

use super::data_sets::*;
use super::support::*;
use crate::{Event, Options};
use randt_geometry::elementary::{cos, sin};

/// One azimuth as a message; all numbers as bytes in network order, or as numbers.
pub(super) fn fft(turn: i64, azimuth: usize, as_bytes: bool) -> Vec<u8> {
    let mut pen = Pen::new(Style::CdrLittle);
    let stamp_ns = time_ns(turn, azimuth);
    pen.header(stamp_ns, "radar");
    let (encoder, counter) = (azimuth as u16 * 14, azimuth as u16);
    let (seconds, nanos) = (
        (stamp_ns / 1_000_000_000) as u32,
        (stamp_ns % 1_000_000_000) as u32,
    );
    if as_bytes {
        pen.blob(&0.5_f64.to_be_bytes());
        pen.blob(&encoder.to_be_bytes());
        pen.blob(&counter.to_be_bytes());
        pen.blob(&seconds.to_be_bytes());
        pen.blob(&nanos.to_be_bytes());
        pen.blob(&powers(azimuth, 100));
        pen.blob(&100_u16.to_be_bytes());
    } else {
        pen.f64(0.5);
        pen.u16(encoder);
        pen.u16(counter);
        pen.u32(seconds);
        pen.u32(nanos);
        pen.blob(&powers(azimuth, 100));
        pen.u16(100);
    }
    pen.bytes
}

/// The radar's configuration, bins of 0.1752 m.
pub(super) fn configuration(as_bytes: bool) -> Vec<u8> {
    let mut pen = Pen::new(Style::CdrLittle);
    pen.header(START_NS, "radar");
    if as_bytes {
        for bytes in [
            &400_u16.to_be_bytes()[..],
            &5600_u16.to_be_bytes(),
            &1752.0_f64.to_be_bytes(),
        ] {
            pen.blob(bytes);
        }
        pen.blob(&100_u16.to_be_bytes());
        pen.blob(&4_u16.to_be_bytes());
    } else {
        [400, 5600, 0].into_iter().for_each(|value| pen.u16(value));
        pen.f32(0.1752);
        [100, 4].into_iter().for_each(|value| pen.u16(value));
        [1.0, 0.0].into_iter().for_each(|value| pen.f32(value));
    }
    pen.bytes
}

#[test]
fn navtechs_messages_are_turns() {
    for as_bytes in [true, false] {
        let mut messages = vec![TestMessage {
            topic: "/radar_data/configuration_data",
            type_name: "messages/RadarConfigurationMessage",
            arrival_ns: START_NS,
            bytes: configuration(as_bytes),
        }];
        for (turn, azimuth) in (0..3).flat_map(|turn| (0..AZIMUTHS).map(move |a| (turn, a))) {
            messages.push(TestMessage {
                topic: "/radar_data/fft_data",
                type_name: "messages/RadarFftDataMessage",
                arrival_ns: time_ns(turn, azimuth) + 1_000_000,
                bytes: fft(turn, azimuth, as_bytes),
            });
        }
        let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
        let (events, source) = read_all(&path);
        assert_eq!(source.info().scans, Some(3));
        check(&events, 0.1752, "FFT messages");
    }
}

#[test]
fn polar_images_may_be_messages() {
    for in_columns in [false, true] {
        let image = |turn: i64| {
            let rows = if in_columns {
                columns(576)
            } else {
                rows(turn, 100, 1000)
            };
            let mut pen = Pen::new(Style::CdrLittle);
            pen.header(START_NS + (turn + 1) * PERIOD_NS, "b_scan_image");
            pen.u32(rows.len() as u32);
            pen.u32(rows[0].len() as u32);
            pen.string("mono8");
            pen.u8(0);
            pen.u32(rows[0].len() as u32);
            pen.blob(&rows.concat());
            TestMessage {
                topic: "/radar_data/b_scan",
                type_name: "sensor_msgs/Image",
                arrival_ns: START_NS + (turn + 1) * PERIOD_NS + 2_000_000,
                bytes: pen.bytes,
            }
        };
        let messages: Vec<_> = (0..3).map(image).collect();
        let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
        let options = Options {
            bin_size_m: Some(0.1752),
            ..Options::default()
        };
        check(&read_with(&path, &options).0, 0.1752, "images");
    }
}

#[test]
fn navtechs_clouds_are_mirrored() {
    let mirror = |cloud: TestCloud| TestCloud {
        points: cloud
            .points
            .into_iter()
            .map(|(x, y, i)| (x, -y, i))
            .collect(),
        ..cloud
    };
    let write = |mirrored: bool, values: u32| {
        let mut random = Random(4);
        let message = |number: i64| {
            let stamp_ns = START_NS + number * 200_000_000;
            let cloud = cloud(stamp_ns, &mut random);
            let cloud = if mirrored { mirror(cloud) } else { cloud };
            let layout = CloudLayout {
                values: if values == 0 {
                    cloud.points.len() as u32
                } else {
                    values
                },
                ..CloudLayout::AS_PUBLISHED
            };
            TestMessage {
                topic: "/radar_data/point_cloud",
                type_name: CLOUD,
                arrival_ns: stamp_ns,
                bytes: cloud.serialise(Style::CdrLittle, &layout),
            }
        };
        let messages: Vec<_> = (1..=9).map(message).collect();
        file("a.mcap", &mcap_bag(&messages, 40_000))
    };
    let points = |events: &[Event]| -> Vec<(i64, i64)> {
        let mut points = Vec::new();
        for scan in sweeps(events) {
            for item in &scan.items {
                let azimuth =
                    f64::from(scan.head.sweep.beams()[usize::from(item.beam)].azimuth_rad);
                let range = f64::from(item.range_m);
                let rounded = |value: f64| (value * 1000.0).round() as i64;
                points.push((rounded(range * cos(azimuth)), rounded(range * sin(azimuth))));
            }
        }
        points.sort_unstable();
        points
    };
    let (_folder, plain) = write(false, 1);
    let expected = points(&read_all(&plain).0);
    // Its driver gives each field as many values as there are points.
    let (_folder, navtech) = write(true, 0);
    let (events, source) = read_all(&navtech);
    assert!(points(&events) == expected);
    assert!(
        source
            .counters()
            .iter()
            .any(|c| c.name == "clouds_mirrored")
    );
    // Named by hand.
    let (_folder, other) = write(true, 1);
    let options = Options {
        mirrored: Some(true),
        ..Options::default()
    };
    assert!(points(&read_with(&other, &options).0) == expected);
    assert!(points(&read_all(&other).0) != expected);
}

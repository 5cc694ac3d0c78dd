//! What is taken where a recording leaves a choice: fields by words in their names, the IMU that
//! has a place on the robot, a data set's IMU by its header.

use super::data_sets::{rows, write, write_image};
use super::support::*;
use crate::{Event, Options};
use randt_messages::SensorKind;

const STYLE: Style = Style::CdrLittle;

fn counters(source: &dyn crate::Source) -> Vec<(&'static str, String)> {
    let counters = source.counters().into_iter();
    counters.map(|c| (c.name, c.first)).collect()
}

#[test]
fn a_word_in_a_fields_name_makes_it_the_intensity() {
    let with_name = |intensity_name| {
        let layout = CloudLayout {
            intensity_name,
            ..CloudLayout::AS_PUBLISHED
        };
        let bag = mcap_bag(&recording(STYLE, &layout, 9), 40_000);
        let (_folder, path) = file("a.mcap", &bag);
        let (events, source) = read_all(&path);
        (fingerprint(&events), counters(source.as_ref()))
    };
    let (expected, _) = with_name("intensity");
    for name in ["rcs_db", "Power_dB", "signal_intensity"] {
        let (events, counters) = with_name(name);
        assert!(events == expected, "{name}");
        let [("intensity_assumed", first)] = counters.as_slice() else {
            panic!("{counters:?}");
        };
        assert!(first.contains(name), "{first}");
    }
    for name in ["noise_power", "rcs_var"] {
        let (events, counters) = with_name(name);
        assert!(events != expected);
        assert_eq!(counters[0].0, "returns_without_intensity", "{name}");
    }
}

#[test]
fn of_two_imus_the_one_with_a_place_on_the_robot_is_taken() {
    let mut messages = recording(STYLE, &CloudLayout::AS_PUBLISHED, 9);
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let expected = fingerprint(&read_all(&path).0);
    // A camera's own, twice as fast, of whose frame nothing is known.
    let own = messages.iter().filter(|m| m.topic == "/imu/data");
    let camera = own.flat_map(|message| [0, 1].map(|later_ns| (message, later_ns)));
    let camera = camera.map(|(message, later_ns)| {
        let text = message.bytes.windows(8).position(|w| w == b"imu_link");
        let mut bytes = message.bytes.clone();
        bytes[text.unwrap()..][..8].copy_from_slice(b"cam_link");
        TestMessage {
            topic: "/camera/imu",
            arrival_ns: message.arrival_ns + later_ns,
            bytes,
            ..message.clone()
        }
    });
    let camera: Vec<TestMessage> = camera.collect();
    messages.extend(camera);
    messages.sort_by_key(|message| message.arrival_ns);
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let (events, source) = read_all(&path);
    assert!(fingerprint(&events) == expected);
    let [("imu_topic_chosen", first)] = &counters(source.as_ref())[..] else {
        panic!("{:?}", source.counters());
    };
    assert!(first.starts_with("/imu/data of /imu/data (450), /camera/imu (900)"));
}

#[test]
fn one_sweep_that_is_off_by_less_than_a_second_is_left_out() {
    for off_ns in [-1_000_000_000, -300_000_000, 700_000_000] {
        let mut messages = recording(STYLE, &CloudLayout::AS_PUBLISHED, 20);
        let end_ns = 1_700_000_000_000_000_000 + 12 * 200_000_000;
        let mut sweeps = messages.iter_mut().filter(|m| m.topic == "/radar/points");
        let cloud = cloud(end_ns + off_ns, &mut Random(9));
        sweeps.nth(11).unwrap().bytes = cloud.serialise(STYLE, &CloudLayout::AS_PUBLISHED);
        let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
        let (events, source) = read_all(&path);
        assert_eq!(events.len(), 20 * 51 - 1, "{off_ns}");
        assert!(events.is_sorted_by_key(Event::stamp_ns), "{off_ns}");
        assert_eq!(counters(source.as_ref())[0].0, "stamps_off", "{off_ns}");
    }
}

#[test]
fn boreas_imus_are_read_by_their_header_and_hang_as_the_data_set_says() {
    // The file, its two lines, and what a rate to the left and a force forward are in base_link.
    for (name, table) in [
        (
            "applanix/imu.csv",
            "GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n1700000000.1,0.25,0,0,9.8,0.5,-0.125\n",
        ),
        (
            "applanix/imu_raw.csv",
            "GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n1700000000.1,-0.25,0,0,-9.8,0.125,-0.5\n",
        ),
        (
            "imu/dmu_imu.csv",
            "time,raw_count,qx,qy,qz,qw,wx,wy,wz,ax,ay,az\n1700000000100000000,7,0,0,0,1,0,0,0.25,0.5,0.125,9.8\n",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("radar/1700000000000000.png");
        write_image(&image, &rows(0, 100, 1000));
        std::fs::create_dir_all(folder.path().join("applanix")).unwrap();
        write(&folder.path().join(name), table);
        let options = Options {
            bin_size_m: Some(0.05),
            ..Options::default()
        };
        let (events, source) = read_with(folder.path(), &options);
        let sample = events.iter().find_map(|event| match event {
            Event::Imu(sample) => Some(sample),
            _ => None,
        });
        let sample = sample.unwrap();
        let imu = source.info().extrinsics.imu.unwrap_or_default();
        for (measured, expected) in [
            (sample.rate_rad_s, [0.0, 0.0, 0.25]),
            (sample.acceleration_m_s2, [0.5, 0.125, 9.8]),
        ] {
            let found: [f64; 3] = imu.rotate(measured.into()).into();
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{name}: {found}");
            }
        }
    }
}

#[test]
fn a_navtechs_clouds_name_their_radar_and_its_bins() {
    use randt_geometry::elementary::{PI, sin_cos};
    // Two returns a beam, on bins of 0.0876 m.
    let bin_m = 0.0876;
    let point = |index: usize| {
        let (sin, cos) = sin_cos((index / 2) as f64 * 2.0 * PI / 400.0);
        let bin = (60 + index / 2 % 90 + index % 2 * (1 + index / 2 % 4)) as f64;
        let range_m = (bin + 0.5) * bin_m;
        let single = |value: f64| f64::from(value as f32);
        (single(range_m * cos), single(range_m * sin), 90.0)
    };
    let points: Vec<_> = (0..800).map(point).collect();
    for (values, sensor) in [
        (800, SensorKind::NavtechCts),
        // Not its driver's.
        (1, SensorKind::Unknown),
    ] {
        let layout = CloudLayout {
            values,
            ..CloudLayout::AS_PUBLISHED
        };
        let message = |number: i64| {
            let stamp_ns = 1_700_000_000_000_000_000 + number * 250_000_000;
            let points = points.clone();
            TestMessage {
                topic: "/radar_data/point_cloud",
                type_name: CLOUD,
                arrival_ns: stamp_ns,
                bytes: TestCloud { stamp_ns, points }.serialise(STYLE, &layout),
            }
        };
        let messages: Vec<_> = (1..=9).map(message).collect();
        let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 400_000));
        let (_, source) = read_all(&path);
        assert_eq!(source.info().sensor, sensor);
        let size_m = source.info().bin_size.and_then(|bins| bins.size_m);
        assert_eq!(size_m.is_some(), sensor == SensorKind::NavtechCts);
        assert!(size_m.is_none_or(|size_m| (size_m - bin_m).abs() < 1e-5));
    }
}

//! Inputs of every form with a damaged file: read or refused, within a time and a memory.
//!
//! The short form draws 60; the long one, some minutes:
//!
//! ```text
//! cargo test --workspace --lib -- --ignored two_thousand
//! ```

use super::damage::mutate;
use super::data_sets::{START_NS, columns, rows, time_ns, write, write_image};
use super::navtech::{configuration, fft};
use super::support::*;
use crate::{Options, open};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time for one input: a hang takes longer.
const TIME_MAX: Duration = Duration::from_secs(20);
/// Most memory that the whole test takes, kB.
const MEMORY_MAX_KB: u64 = 1_000_000;

#[test]
fn mutated_inputs_are_read_or_refused() {
    mutations(60);
}

#[test]
#[ignore = "a minute"]
fn two_thousand_mutated_inputs_are_read_or_refused() {
    mutations(2000);
}

/// Damages a file of each form by turns.
fn mutations(count: usize) {
    let seed = 20_261_130;
    println!("seed {seed}, {count} mutations");
    let mut random = Random(seed);
    let folder = tempfile::tempdir().unwrap();
    let inputs = inputs(folder.path());
    let options = Options {
        bin_size_m: Some(0.05),
        radar_required: false,
        ..Options::default()
    };
    let mut refused = 0;
    for number in 0..count {
        let (input, file) = &inputs[number % inputs.len()];
        let whole = std::fs::read(file).unwrap();
        std::fs::write(file, mutate(&mut random, &whole)).unwrap();
        let begin = Instant::now();
        match open(input, &options) {
            Ok(mut source) => while let Ok(Some(_)) = source.next_event() {},
            Err(_) => refused += 1,
        }
        assert!(begin.elapsed() < TIME_MAX, "mutation {number} of {file:?}");
        std::fs::write(file, whole).unwrap();
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find(|line| line.starts_with("VmHWM:"));
    let peak_kb = peak.and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok());
    println!("{refused} of {count} refused, {peak_kb:?} kB at most");
    assert!(peak_kb.unwrap() < MEMORY_MAX_KB, "{peak_kb:?} kB");
}

/// Inputs of every form in this folder: what is opened, and the file of it that is damaged.
fn inputs(root: &Path) -> Vec<(PathBuf, PathBuf)> {
    let mut inputs = Vec::new();
    let mut add = |input: &str, file: &str| {
        let input = root.join(input);
        inputs.push((input.clone(), input.join(file)));
    };
    for name in ["oxford", "boreas"] {
        let image = root.join(name).join("radar/1700000000000000.png");
        write_image(&image, &rows(0, 60, 1000));
        add(name, "radar/1700000000000000.png");
    }
    write(
        &root.join("oxford/radar.timestamps"),
        "1700000000000000 1\n",
    );
    add("oxford", "radar.timestamps");
    write(
        &root.join("boreas/applanix/imu_raw.csv"),
        "t,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n1700000000.1,0.1,0,0,9.8,0,0\n",
    );
    add("boreas", "applanix/imu_raw.csv");
    write_image(
        &root.join("mulran/polar/1700000000250000000.png"),
        &columns(60),
    );
    add("mulran", "polar/1700000000250000000.png");
    write(
        &root.join("mulran/xsens_imu.csv"),
        "1700000000250000000,0,0,0,1,0,0,0,0,0,1,0,0,9,1,2,3\n",
    );
    add("mulran", "xsens_imu.csv");
    write_image(&root.join("radiate/Navtech_Polar/000001.png"), &columns(60));
    for list in ["Navtech_Polar.txt", "GPS_IMU_Twist.txt"] {
        let path = root.join("radiate").join(list);
        write(&path, "Frame: 000001 Time: 1574859771.744660272\n");
        add("radiate", list);
    }
    write(
        &root.join("radiate/GPS_IMU_Twist/000001.txt"),
        "1 2 3\n1\n2\n3\n0 0 0 1\n0 0 1\n0 0 9.8\n",
    );
    add("radiate", "GPS_IMU_Twist/000001.txt");
    let navtech = navtech_messages();
    write(&root.join("navtech/a_0.mcap"), mcap_bag(&navtech, 4000));
    add("navtech", "a_0.mcap");
    let packed = zstd::encode_all(mcap_bag(&navtech, 4000).as_slice(), 1).unwrap();
    write(&root.join("navtech/a_1.mcap.zstd"), packed);
    add("navtech", "a_1.mcap.zstd");
    for compression in ["none", "lz4", "bz2"] {
        let messages = recording(Style::Ros1, &CloudLayout::AS_PUBLISHED, 9);
        let bag = ros1_bag(&messages, compression, 103);
        let name = format!("{compression}.bag");
        write(&root.join(&name), bag);
        add(&name, "");
    }
    let messages = recording(Style::CdrLittle, &CloudLayout::AS_PUBLISHED, 9);
    let [first, second] = [0..240, 200..messages.len()].map(|part| &messages[part]);
    write(&root.join("split/a_0.mcap"), mcap_bag(first, 9000));
    write(&root.join("split/a_1.mcap"), mcap_bag(second, 9000));
    add("split", "a_0.mcap");
    database_bag(&messages, &root.join("a.db3"));
    add("a.db3", "");
    let (events, source) = read_all(&root.join("split"));
    let log = log_of(&events, source.info());
    write(&root.join("mission/logs/a.mcap"), &log);
    write(&root.join("mission/logs/b.mcap.active"), &log);
    add("mission", "logs/a.mcap");
    add("mission", "logs/b.mcap.active");
    // A file is opened by itself.
    for (input, file) in &mut inputs {
        if input.is_file() {
            file.clone_from(input);
        }
    }
    inputs
}

/// Some azimuths of Navtech's driver, and messages that are taken for a radar's where there is
/// none.
fn navtech_messages() -> Vec<TestMessage> {
    let message = |topic, type_name, bytes| TestMessage {
        topic,
        type_name,
        arrival_ns: START_NS,
        bytes,
    };
    let mut messages = vec![
        message(
            "/radar_data/configuration_data",
            "messages/RadarConfigurationMessage",
            configuration(true),
        ),
        message("/scan", "sensor_msgs/LaserScan", laser_scan()),
    ];
    messages.extend((0..40).map(|azimuth| TestMessage {
        arrival_ns: time_ns(0, azimuth),
        ..message(
            "/radar_data/fft_data",
            "messages/RadarFftDataMessage",
            zstd::encode_all(fft(0, azimuth, azimuth % 2 == 0).as_slice(), 1).unwrap(),
        )
    }));
    messages
}

fn laser_scan() -> Vec<u8> {
    let mut pen = Pen::new(Style::CdrLittle);
    pen.header(START_NS, "laser");
    for value in [-3.0, 3.0, 0.1, 0.0, 0.2, 0.1, 50.0] {
        pen.f32(value);
    }
    for _ in 0..2 {
        pen.u32(60);
        (0..60).for_each(|index| pen.f32(index as f32));
    }
    pen.bytes
}

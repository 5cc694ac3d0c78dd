//! A simulated log whose IMU stamps are like those of a Phidgets Spatial: off the scans, and with
//! its jitter.

use super::Random;
use randt_geometry::elementary::ln;
use randt_log::{LogFile, LogReader, Options, ROBOT_METADATA};
use randt_messages::{ImuSampleTopic, RadarScan, TruthPoseTopic};
use std::path::Path;

/// The first sample after the end of a sweep follows it by this time, ns.
pub const OFF_NS: i64 = 1_700_000;
/// The simulator's samples come every 4 ms, one of them 0.3 ms before a sweep ends.
const SHIFT_NS: i64 = 2_000_000;
/// A Phidgets Spatial at 250 Hz, stamped when a sample reached the host (13,964 of them): 90 % of
/// the intervals are 4 ms to within 0.15 ms; 1 % are above 5.8 ms, 0.1 % above 8.0 ms, the longest
/// has 10.9 ms and the shortest, of the samples that had to queue up behind a late one, 0.7 ms.
/// That is what this gives: one sample in sixteen comes late, by 1 ms on average, and what follows
/// it waits.
const NOISE_NS: f64 = 75_000.0;
const LATE_ONE_IN: usize = 16;
const LATE_MEAN_NS: f64 = 980_000.0;
const INTERVAL_MIN_NS: i64 = 700_000;

/// Copies a log with other IMU stamps; gives them.
pub fn restamp(from: &Path, to: &Path, seed: u64) -> Vec<i64> {
    let mut reader = LogReader::open(from).unwrap();
    let mut log = LogFile::create(to, Options::default()).unwrap();
    let robot = reader.robot().unwrap();
    log.write_metadata(ROBOT_METADATA, robot.to_metadata())
        .unwrap();
    let mut random = Random(seed);
    let mut stamps: Vec<i64> = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        if let Some(mut sample) = entry.decode::<ImuSampleTopic>().unwrap() {
            let noise_ns = (2.0 * unit(&mut random) - 1.0) * NOISE_NS;
            let is_late = random.below(LATE_ONE_IN) == 0;
            let late_ns = f64::from(u8::from(is_late)) * -ln(unit(&mut random)) * LATE_MEAN_NS;
            let header = &mut sample.head.header;
            header.stamp_ns += SHIFT_NS + (noise_ns + late_ns) as i64;
            if let Some(before) = stamps.last() {
                header.stamp_ns = header.stamp_ns.max(before + INTERVAL_MIN_NS);
            }
            stamps.push(header.stamp_ns);
            log.write(sample.as_ref()).unwrap();
        } else if let Some(scan) = entry.decode::<RadarScan>().unwrap() {
            log.write(scan.as_ref()).unwrap();
        } else if let Some(truth) = entry.decode::<TruthPoseTopic>().unwrap() {
            log.write(truth.as_ref()).unwrap();
        }
    }
    log.finish().unwrap();
    stamps
}

/// Evenly in (0, 1].
fn unit(random: &mut Random) -> f64 {
    ((random.next() >> 11) + 1) as f64 / (1_u64 << 53) as f64
}

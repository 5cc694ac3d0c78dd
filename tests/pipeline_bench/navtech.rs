//! A long-range radar's case for memory: scans of 400 beams and 30,000 returns, made here, through
//! filter and odometry.

use crate::support::stages::{RunFolder, memory};
use randt_messages::{
    Beam, ImuSample, ImuSampleTopic, Message, MessageRef, OdometryStateTopic, RadarScan, Return,
    SensorKind,
};
use randt_stage::{Stage, WakeReason};
use std::time::{Duration, Instant};

const BEAMS: u32 = 400;
const RETURNS_PER_BEAM: u32 = 75;
/// Four sweeps a second; the histories are full after 8 s.
const PERIOD: Duration = Duration::from_millis(250);
const SCANS: u64 = 48;
/// Samples of 250 Hz, sent with the scan that they cover.
const SAMPLES: u64 = 62;

/// Drives and prints the most memory that was in use.
pub fn print(folder: &RunFolder) {
    println!(
        "\nNavtech: {BEAMS} beams, {} returns a scan",
        BEAMS * RETURNS_PER_BEAM
    );
    let domain = folder.domain("navtech");
    let mut running = ["mapper", "odometry", "filter"].map(|name| {
        let mut command = RunFolder::command(&domain, name);
        command.args(["--sensor", "navtech-cts"]);
        folder.start(name, command)
    });
    let mut stage = Stage::open("navtech", &domain).unwrap();
    let mut scans = stage.publisher::<RadarScan>().unwrap();
    let mut samples = stage.publisher::<ImuSampleTopic>().unwrap();
    let mut states = stage.subscriber::<OdometryStateTopic>().unwrap();
    stage.running().unwrap();
    let (mut scan, mut points, mut count, mut most) = (Message::default(), 0, 0, 0);
    for number in 0..SCANS {
        let due = Instant::now() + PERIOD;
        let end_ns = stage.clock().now_ns();
        sweep(&mut scan, number, end_ns);
        scans.publish(scan.as_ref()).unwrap();
        for i in (0..SAMPLES).rev() {
            let mut sample = ImuSample::default();
            sample.header.stamp_ns = end_ns - i as i64 * 4_000_000;
            sample.arrival_ns = sample.header.stamp_ns;
            sample.acceleration_m_s2 = [0.0, 0.0, 9.81];
            let (head, items) = (&sample, &[]);
            samples.publish(MessageRef { head, items }).unwrap();
        }
        loop {
            let pause = due.saturating_duration_since(Instant::now());
            let woken = stage.wait(&[&states], Some(pause)).unwrap();
            while let Some(state) = states.receive().unwrap() {
                (count, points) = (count + 1, points + u64::from(state.message().head.points));
            }
            if woken != WakeReason::Event {
                break;
            }
        }
        most = most.max(memory(&domain));
    }
    println!(
        "{count} of {SCANS} states, {} points a scan, {:.1} MB in use at most",
        points / count.max(1),
        most as f64 * 1e-6
    );
    stage.close().unwrap();
    for running in &mut running {
        let status = running.stop();
        assert!(
            status.success(),
            "{}: {status}: {}",
            running.name,
            running.stderr()
        );
    }
}

/// A square of 80 m seen from its middle: a strong echo in front of a tail, and weak ones before.
fn sweep(scan: &mut Message<RadarScan>, number: u64, end_ns: i64) {
    let mut random = number.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let period_ns = PERIOD.as_nanos() as i64;
    let head = &mut *scan.head;
    head.header.stamp_ns = end_ns;
    let sweep = &mut head.sweep;
    (sweep.begin_ns, sweep.end_ns) = (end_ns - period_ns, end_ns);
    sweep.sensor = SensorKind::NavtechCts as u32;
    sweep.beam_count = BEAMS;
    scan.items.clear();
    for beam in 0..BEAMS {
        let azimuth =
            f64::from(beam) / f64::from(BEAMS) * std::f64::consts::TAU - std::f64::consts::PI;
        sweep.beams[beam as usize] = Beam {
            stamp_ns: sweep.begin_ns + i64::from(beam + 1) * period_ns / i64::from(BEAMS),
            azimuth_rad: azimuth as f32,
            first_return: beam * RETURNS_PER_BEAM,
        };
        let (sin, cos) = randt_geometry::elementary::sin_cos(azimuth);
        let wall_m = 40.0 / sin.abs().max(cos.abs());
        let wall_bin = (wall_m / 0.0438) as u32;
        for i in 0..RETURNS_PER_BEAM {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let bin = wall_bin - 40 + i;
            let noise = (random % 16) as f32;
            let off = (bin as f32 - wall_bin as f32).abs();
            scan.items.push(Return {
                range_m: bin as f32 * 0.0438,
                intensity: (160.0 - 20.0 * off).max(60.0) + noise,
                beam: beam as u16,
                bin: bin as u16,
            });
        }
    }
}

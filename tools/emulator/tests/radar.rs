//! Emulated radars through the driver, without a process: what is in the log comes out of it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use randt_emulator::radar::{Format, Order};
use randt_messages::{Message, RadarScan, SensorKind};
use std::time::{Duration, Instant};
use support::{BEAMS, Emulator, RadarProtocol, TURN_NS, count, free, log, poll, radar, scan};

const SWEEPS: usize = 15;

/// Plays a log into the driver: its sweeps with the log's, and the emulator's clock.
fn through(protocol: RadarProtocol, clockwise: bool) -> (Vec<Message<RadarScan>>, Emulator) {
    let folder = tempfile::tempdir().unwrap();
    let path = log(&folder, SWEEPS, clockwise);
    let address = free(protocol);
    let mut radar = radar(protocol, address);
    let mut out = Vec::new();
    // Half a second passes before the log's first stamp.
    let emulator = Emulator::start(path, protocol, address, &[]);
    let mut over: Option<Instant> = None;
    poll(
        &mut radar,
        |sweep, _| out.push(sweep.message(SensorKind::IsdrC)),
        |_| {
            let since = emulator
                .is_over()
                .then(|| *over.get_or_insert_with(Instant::now));
            since.is_some_and(|since| since.elapsed() > Duration::from_millis(200))
        },
    );
    let counters = radar.counters();
    for name in ["beams_lost", "beams_late", "beams_doubled"] {
        assert_eq!(count(&counters, name), 0, "{name} {counters:?}");
    }
    assert_eq!(radar.lost(), 0, "{counters:?}");
    (out, emulator)
}

/// Every return of the log is there, its direction, range, strength and time.
fn compare(
    protocol: RadarProtocol,
    clockwise: bool,
    first: usize,
    step_intensity: f32,
    step_rad: f32,
) {
    let (out, emulator) = through(protocol, clockwise);
    assert!(out.len() >= SWEEPS - first, "{} sweeps", out.len());
    let skipped = SWEEPS - out.len();
    for (number, message) in out.iter().enumerate() {
        let truth = scan(number + skipped, clockwise);
        let (head, expected) = (&message.head.sweep, &truth.head.sweep);
        assert_eq!(head.beam_count as usize, BEAMS);
        assert_eq!(
            (head.beams_lost, head.sensor),
            (0, SensorKind::IsdrC as u32)
        );
        assert!((head.range_resolution_m - expected.range_resolution_m).abs() < 1e-7);
        assert_eq!(message.items.len(), truth.items.len());
        for (item, wanted) in message.items.iter().zip(&truth.items) {
            assert_eq!((item.beam, item.bin), (wanted.beam, wanted.bin));
            assert!(
                (item.range_m - wanted.range_m).abs() < 2e-5,
                "{item:?} {wanted:?}"
            );
            assert!((item.intensity - wanted.intensity).abs() <= step_intensity);
        }
        // The sweep's own stamp, not that of another one or of its beginning. How near depends on
        // how soon beams arrive: a few milliseconds, on a busy machine more.
        let end_ns = emulator.pace.unix_ns(expected.end_ns);
        let late_ns = message.head.header.stamp_ns - end_ns;
        let turn_ns = head.end_ns - head.begin_ns;
        println!("{number}: {late_ns} ns late, a turn of {turn_ns} ns");
        assert!(late_ns.abs() < TURN_NS / 4, "{late_ns} ns late");
        assert!((turn_ns - TURN_NS).abs() < TURN_NS / 10, "{turn_ns} ns");
        for (beam, wanted) in head.beams().iter().zip(expected.beams()) {
            let turned = (beam.azimuth_rad - wanted.azimuth_rad).abs();
            assert!(turned.min(std::f32::consts::TAU - turned) <= step_rad);
        }
    }
    let sent = emulator.stop();
    assert_eq!(sent.beams as usize, SWEEPS * BEAMS);
}

#[test]
fn beam_udp_sparse() {
    compare(RadarProtocol::BeamUdp(Format::Sparse), false, 0, 0.06, 1e-5);
}

#[test]
fn beam_udp_dense_8() {
    compare(RadarProtocol::BeamUdp(Format::Dense8), true, 0, 0.26, 1e-5);
}

#[test]
fn beam_udp_dense_16_in_fragments() {
    compare(
        RadarProtocol::BeamUdp(Format::Dense16),
        false,
        0,
        0.01,
        1e-5,
    );
}

/// The encoder has 5600 counts: half of one is 0.6 mrad.
const COUNT_RAD: f32 = 0.0007;

#[test]
fn navtech_8_bits_lowest_byte_first() {
    let protocol = RadarProtocol::Navtech {
        sixteen: false,
        order: Order::Little,
    };
    compare(protocol, true, 1, 0.5, COUNT_RAD);
}

#[test]
fn navtech_16_bits_highest_byte_first() {
    let protocol = RadarProtocol::Navtech {
        sixteen: true,
        order: Order::Big,
    };
    compare(protocol, true, 1, 0.01, COUNT_RAD);
}

#[test]
fn a_radar_that_is_not_there_is_tried_until_it_is() {
    for protocol in [
        RadarProtocol::Navtech {
            sixteen: false,
            order: Order::Little,
        },
        RadarProtocol::BeamUdp(Format::Sparse),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = log(&folder, SWEEPS, true);
        let address = free(protocol);
        let mut radar = radar(protocol, address);
        let begin = Instant::now();
        poll(
            &mut radar,
            |_, _| panic!("no emulator has begun"),
            |_| begin.elapsed() > Duration::from_millis(1500),
        );
        let text = radar.link().text().to_owned();
        assert!(
            !radar.link().streams() && text.contains(&address.to_string()),
            "{text:?}"
        );
        let word = if matches!(protocol, RadarProtocol::Navtech { .. }) {
            "connection refused"
        } else {
            "no datagram"
        };
        assert!(text.contains(word), "{text:?}");
        let emulator = Emulator::start(path, protocol, address, &[]);
        let (mut sweeps, mut streamed) = (0, false);
        poll(
            &mut radar,
            |_, _| sweeps += 1,
            |radar| {
                streamed |= radar.link().streams();
                emulator.is_over()
            },
        );
        assert!(sweeps >= 5 && streamed, "{sweeps} {:?}", radar.counters());
        emulator.stop();
    }
}

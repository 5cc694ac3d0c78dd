//! Strangers on the radar's wire: what they send changes nothing where the radar is pinned, and is
//! reported where it is not.

mod live;

use crate::support::drive::events;
use crate::support::pipeline::{log, until};
use crate::support::sensors::unix_s;
use live::{Ending, Live, attack, recorded_after};
use randt_config::{Config, DevicePin, SenderPin};
use randt_filter::ClusterFilter;
use randt_messages::{
    Keyframe, Message, MessageRef, OdometryState, RadarPoints, RadarScan, SensorKind, Trust,
};
use randt_odometry::{Odometry, Sink};
use randt_radar::beam_udp::BeamUdpDecoder;
use randt_radar::beam_udp::packet::{Format, Packet, encode_value};
use randt_radar::{BeamDecoder, Echo, Streams};
use randt_simulator::{Event, Robot};
use std::f64::consts::TAU;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A driver that is attacked reports it within this time.
const REPORTED_MAX_NS: i64 = 2_000_000_000;
const PATIENCE_NS: i64 = 1_000_000_000;
/// The radar's, and the stranger's.
const RADAR: ([u8; 4], u16) = ([192, 168, 0, 20], 4000);
const STRANGER: ([u8; 4], u16) = ([192, 168, 0, 66], 5000);
const DEVICE: u32 = 7;

/// A datagram on the wire.
struct Sent {
    from: SocketAddr,
    arrival_ns: i64,
    bytes: Vec<u8>,
}

/// A sweep's beams as datagrams, each when it was measured; `change` makes them another's.
fn datagrams(
    scan: &Message<RadarScan>,
    number: u32,
    change: impl Fn(&mut Packet<'_>),
) -> Vec<Vec<u8>> {
    let sweep = &scan.head.sweep;
    let total = scan.items.len();
    let encode = |at: usize, beam: &randt_messages::Beam| {
        let mut values = Vec::new();
        for item in &scan.items[sweep.returns_of(at, total)] {
            let (bin, intensity) = (item.bin, item.intensity);
            encode_value(Format::Sparse, Echo { bin, intensity }, &mut values);
        }
        let mut packet = Packet {
            format: Format::Sparse,
            device: DEVICE,
            sweep: number,
            beam: at as u16,
            beams: sweep.beam_count as u16,
            fragment: 0,
            fragments: 1,
            first_bin: 0,
            flags: 0,
            azimuth: (f64::from(beam.azimuth_rad) / TAU * 4_294_967_296.0) as i64 as u32,
            device_ns: beam.stamp_ns.unsigned_abs(),
            resolution_um: (sweep.range_resolution_m * 1e6).round() as u32,
            offset_um: 0,
            values: &values,
        };
        change(&mut packet);
        let mut bytes = Vec::new();
        packet.encode(&mut bytes);
        bytes
    };
    sweep
        .beams()
        .iter()
        .enumerate()
        .map(|(at, beam)| encode(at, beam))
        .collect()
}

/// The kind of attack.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Attack {
    /// Five datagrams a second with the radar's device number and random numbers of sweeps.
    Random,
    /// It receives the radar's numbers, and sends each sweep before the radar does, moved in
    /// range.
    Ahead,
    /// The same, in step with the radar.
    InStep,
}

/// A drive on the wire, attacked in its middle; gives when that began.
fn wire(drive: &[Event], attack: Option<(Attack, SocketAddr)>) -> (Vec<Sent>, i64) {
    let mut wire = Vec::new();
    let scans = drive.iter().filter(|event| matches!(event, Event::Scan(_)));
    let scans = scans.count() as u32;
    let (mut number, mut random, mut begin_ns) = (1_000_u32, 7_u64, 0);
    for event in drive {
        let Event::Scan(scan) = event else {
            continue;
        };
        let stamps: Vec<i64> = scan
            .head
            .sweep
            .beams()
            .iter()
            .map(|beam| beam.stamp_ns)
            .collect();
        let at = |from: SocketAddr, by_ns: i64, datagrams: Vec<Vec<u8>>| {
            let with_stamp = datagrams.into_iter().zip(stamps.clone());
            with_stamp.map(move |(bytes, stamp_ns)| Sent {
                from,
                arrival_ns: stamp_ns + 300_000 + by_ns,
                bytes,
            })
        };
        wire.extend(at(RADAR.into(), 0, datagrams(scan, number, |_| {})));
        let is_on = (scans / 5..scans * 4 / 5).contains(&(number - 1000));
        if let Some((attack, from)) = attack.filter(|_| is_on) {
            begin_ns = if begin_ns == 0 { stamps[0] } else { begin_ns };
            let moved = |packet: &mut Packet<'_>| packet.offset_um = 1_000_000;
            match attack {
                Attack::Ahead => {
                    wire.extend(at(from, -150_000_000, datagrams(scan, number, moved)))
                }
                Attack::InStep => wire.extend(at(from, -100_000, datagrams(scan, number, moved))),
                Attack::Random => {
                    random = random
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let random = (random >> 32) as u32;
                    let mut all = datagrams(scan, random, moved);
                    let one = at(from, 0, vec![all.swap_remove(random as usize % all.len())]);
                    wire.extend(one);
                }
            }
        }
        number += 1;
    }
    wire.sort_by_key(|sent| sent.arrival_ns);
    (wire, begin_ns)
}

#[derive(Default)]
struct States(Vec<OdometryState>);

impl Sink for States {
    fn state(&mut self, state: &OdometryState) {
        self.0.push(*state);
    }
    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

/// The sweeps that come of a wire, and what odometry makes of them.
fn drive(
    config: &Config,
    wire: &[Sent],
    samples: &[Event],
) -> (Vec<Message<RadarScan>>, Vec<OdometryState>) {
    let mut decoder = BeamUdpDecoder::new(0.0);
    decoder.pin(&config.radar);
    let mut streams = Streams::new((config.sensor.period_s * 1e9) as i64, PATIENCE_NS);
    let mut scans = Vec::new();
    for sent in wire {
        decoder.sent_from(Some(sent.from));
        decoder.decode(&sent.bytes, sent.arrival_ns, &mut |beam| {
            streams.push(beam, &mut |sweep| {
                scans.push(sweep.message(SensorKind::IsdrC))
            });
        });
    }
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut odometry = Odometry::new(config, true);
    let mut points = Message::<RadarPoints>::default();
    let mut states = States::default();
    let mut samples = samples.iter().peekable();
    for scan in &scans {
        while let Some(event) = samples.next_if(|event| event.stamp_ns() < scan.head.sweep.end_ns) {
            if let Event::Imu(sample) = event {
                odometry.push_imu(sample, &mut states);
            }
        }
        filter.process(scan.as_ref(), &mut points);
        odometry.push_points(points.as_ref(), &mut states);
    }
    odometry.finish(&mut states);
    (scans, states.0)
}

/// As simulated: the radar sits before the robot's middle.
fn config_of_drive() -> Config {
    let mounting = Robot::default().radar_mounting;
    let mut config = Config::default();
    (config.robot.radar_x_m, config.robot.radar_y_m) = (mounting.x_m, mounting.y_m);
    config
}

/// Half a minute with each attack: nothing changes where the radar is pinned; elsewhere trust
/// shows it within 2 s, and what the stranger sends from elsewhere is in no sweep.
#[test]
fn spoofed_sweeps_change_nothing_or_are_reported() {
    let scans = 150;
    let open = config_of_drive();
    let mut pinned = open.clone();
    pinned.radar.device = DevicePin(Some(DEVICE));
    pinned.radar.sender = SenderPin {
        ip: Some(RADAR.0.into()),
        port: None,
    };
    let samples = events(scans);
    let (clean, _) = wire(&samples, None);
    let (clean_scans, clean_states) = drive(&open, &clean, &samples);
    assert_eq!(clean_scans.len() as u64, scans);
    let good =
        |states: &[OdometryState]| states.iter().filter(|s| s.trust() == Trust::Good).count();
    assert!(good(&clean_states) > 120, "{}", good(&clean_states));

    for attack in [Attack::Random, Attack::Ahead, Attack::InStep] {
        let (attacked, begin_ns) = wire(&samples, Some((attack, STRANGER.into())));
        let (scans, states) = drive(&pinned, &attacked, &samples);
        assert!(scans == clean_scans && states == clean_states, "{attack:?}");

        for from in [STRANGER, RADAR] {
            let (attacked, _) = wire(&samples, Some((attack, from.into())));
            let (scans, states) = drive(&open, &attacked, &samples);
            let doubted =
                |s: &&OdometryState| s.header.stamp_ns > begin_ns && s.trust() != Trust::Good;
            let first = states.iter().find(doubted).unwrap().header.stamp_ns - begin_ns;
            let end_ns = begin_ns + 18_000_000_000;
            let reported = begin_ns + REPORTED_MAX_NS..end_ns;
            let during = states
                .iter()
                .filter(|s| reported.contains(&s.header.stamp_ns));
            let during: Vec<OdometryState> = during.copied().collect();
            println!(
                "{attack:?} from {from:?}: doubted after {:.2} s, {} of {} states good from 2 s on, {} sweeps",
                first as f64 * 1e-9,
                good(&during),
                during.len(),
                scans.len()
            );
            assert!(first < REPORTED_MAX_NS, "{attack:?}");
            assert_eq!(good(&during), 0, "{attack:?} from {from:?}");
            if from == STRANGER {
                let poses = |states: &[OdometryState]| -> Vec<[f64; 3]> {
                    states.iter().map(|s| s.pose).collect()
                };
                assert_eq!(poses(&states), poses(&clean_states), "{attack:?}");
            }
        }
    }
}

/// `randt top` and the log report two senders, and trust is not good; with the radar pinned
/// nothing is reported.
#[test]
fn two_senders_show_in_top_log_and_trust() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 300);
    for pin in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let mut live = Live::new(folder.path(), &log, pin);
        let ends = AtomicBool::new(false);
        let begin_ns = (unix_s() * 1e9) as i64;
        std::thread::scope(|scope| {
            let _ending = Ending(&ends);
            scope.spawn(|| attack(&live.address, &ends));
            if pin {
                std::thread::sleep(Duration::from_secs(3));
                let (state, message, _) = live.top();
                assert_eq!((state.as_str(), message.as_str()), ("running", ""));
            } else {
                until("two senders", || {
                    let (state, message, trust) = live.top();
                    state == "degraded"
                        && message.contains("sweeps of two senders, 127.0.0.1 and 127.0.0.2")
                        && trust == "degraded"
                });
            }
        });
        live.end();
        let (output, doubted) = recorded_after(&live.recorded, begin_ns);
        println!("pinned {pin}: the log says it after {output:?} s, trust after {doubted:?} s");
        assert_eq!(output.is_some(), !pin);
        if !pin {
            // By the sweeps' own stamps: the load of the machine does not matter.
            assert!(doubted.is_some_and(|after_s| after_s < 2.0), "{doubted:?}");
        }
    }
}

/// Two pipelines side by side, one of them attacked: garbage, random numbers and whole sweeps.
#[test]
#[ignore = "two minutes on a quiet machine: cargo test --test programs strangers:: -- --ignored --nocapture"]
fn an_attack_does_not_slow_odometry() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 600);
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let mut twins = folders
        .each_ref()
        .map(|folder| Live::new(folder.path(), &log, false));
    let ends = AtomicBool::new(false);
    let begin_ns = (unix_s() * 1e9) as i64;
    std::thread::scope(|scope| {
        let _ending = Ending(&ends);
        let (address, ends) = (&twins[0].address, &ends);
        scope.spawn(|| attack(address, ends));
        scope.spawn(move || {
            let socket = UdpSocket::bind("127.0.0.3:0").unwrap();
            while !ends.load(Ordering::Relaxed) {
                let _ = socket.send_to(b"RBM1 is all of it that is right", address);
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        std::thread::sleep(Duration::from_secs(100));
    });
    twins.iter_mut().for_each(Live::end);
    let [attacked_ms, alone_ms] = twins.each_ref().map(|twin| twin.p99_ms(begin_ns));
    println!("p99 of odometry: attacked {attacked_ms:.3} ms, its twin {alone_ms:.3} ms");
    assert!(attacked_ms <= 1.2 * alone_ms);
}

//! A log of a radar that turns, an emulator of it in a thread, and the driver in this one.
#![allow(dead_code, reason = "not every test needs all")]

use randt_config::{ByteOrder, Config, RadarSource};
use randt_device::Count;
use randt_emulator::radar::{BeamUdpSender, Format, NavtechServer, Order, Sent};
use randt_emulator::{Fault, Faults, Pace, Recording};
use randt_log::{LogFile, Options};
use randt_messages::{Beam, Message, RadarScan, Return, SensorKind};
use randt_radar::{Radar, Sweep};
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

pub const BEAMS: usize = 220;
pub const TURN_NS: i64 = 200_000_000;
const BEGIN_NS: i64 = 7_000_000_000;
const BIN_M: f32 = 0.0161;

/// Sweep `number` of a radar that turns counter-clockwise, or clockwise, its returns all
/// different.
pub fn scan(number: usize, clockwise: bool) -> Message<RadarScan> {
    let mut message = Message::<RadarScan>::default();
    let step_ns = TURN_NS / BEAMS as i64;
    let step_rad = std::f32::consts::TAU / BEAMS as f32;
    let begin_ns = BEGIN_NS + number as i64 * TURN_NS;
    let sweep = &mut message.head.sweep;
    sweep.begin_ns = begin_ns - step_ns / 2;
    sweep.end_ns = begin_ns + TURN_NS - step_ns / 2;
    sweep.sensor = SensorKind::IsdrC as u32;
    sweep.beam_count = BEAMS as u32;
    sweep.range_resolution_m = BIN_M;
    sweep.azimuth_step_rad = step_rad;
    for index in 0..BEAMS {
        // A Navtech's sweep begins at its encoder's zero; any other's anywhere.
        let azimuth_rad = if clockwise {
            let turned = -step_rad * index as f32;
            if turned < -std::f32::consts::PI {
                turned + std::f32::consts::TAU
            } else {
                turned
            }
        } else {
            -std::f32::consts::PI + step_rad * index as f32
        };
        sweep.beams[index] = Beam {
            stamp_ns: begin_ns + step_ns * index as i64,
            azimuth_rad,
            first_return: message.items.len() as u32,
        };
        for echo in 0..40 {
            let bin = (echo * 24 + (index + number) % 20) as u16;
            message.items.push(Return {
                range_m: (f32::from(bin) + 0.5) * BIN_M,
                intensity: (10 + (index * 7 + echo * 3 + number) % 50) as f32,
                beam: index as u16,
                bin,
            });
        }
    }
    message.head.header.stamp_ns = message.head.sweep.end_ns;
    message
}

/// A log of this many sweeps.
pub fn log(folder: &tempfile::TempDir, sweeps: usize, clockwise: bool) -> PathBuf {
    let path = folder.path().join("radar.mcap");
    let mut log = LogFile::create(&path, Options::default()).unwrap();
    for number in 0..sweeps {
        log.write(scan(number, clockwise).as_ref()).unwrap();
    }
    log.finish().unwrap();
    path
}

/// How a log is protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RadarProtocol {
    BeamUdp(Format),
    Navtech { sixteen: bool, order: Order },
}

type Play = Box<dyn FnOnce(&dyn Fn() -> bool) -> Sent + Send>;

/// An emulator that runs.
pub struct Emulator {
    pub address: SocketAddr,
    pub pace: Pace,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<Sent>>,
}

impl Emulator {
    /// Begins at once.
    pub fn start(
        path: PathBuf,
        protocol: RadarProtocol,
        address: SocketAddr,
        faults: &[&str],
    ) -> Self {
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        let faults = Faults::new(faults);
        let recording = Recording::open(&path, false).unwrap();
        let pace = Pace::new(recording.begin_ns(), None);
        let end = Arc::new(AtomicBool::new(false));
        let ending = Arc::clone(&end);
        let (mut bound, thread) = (address, move |play: Play| {
            std::thread::spawn(move || play(&|| ending.load(Ordering::Relaxed)))
        });
        let thread = match protocol {
            RadarProtocol::BeamUdp(format) => {
                let sender = BeamUdpSender::new(address, format).unwrap();
                thread(Box::new(move |ends| {
                    sender.play(recording, &pace, &faults, ends).unwrap()
                }))
            }
            RadarProtocol::Navtech { sixteen, order } => {
                let server = NavtechServer::new(address, sixteen, order).unwrap();
                bound = server.address();
                thread(Box::new(move |ends| {
                    server.play(recording, &pace, &faults, ends).unwrap()
                }))
            }
        };
        Self {
            address: bound,
            pace,
            end,
            thread: Some(thread),
        }
    }

    pub fn is_over(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    pub fn stop(mut self) -> Sent {
        self.end.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }
}

/// A free port of this host.
pub fn free(protocol: RadarProtocol) -> SocketAddr {
    match protocol {
        RadarProtocol::BeamUdp(_) => UdpSocket::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap(),
        RadarProtocol::Navtech { .. } => TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap(),
    }
}

pub fn radar(protocol: RadarProtocol, address: SocketAddr) -> Radar {
    let mut config = Config::default();
    config.radar.source = match protocol {
        RadarProtocol::BeamUdp(_) => RadarSource::BeamUdp,
        RadarProtocol::Navtech { .. } => RadarSource::Navtech,
    };
    config.radar.byte_order = ByteOrder::Auto;
    config.radar.address = address.to_string();
    config.radar.silence_s = 0.5;
    // As much as the kernel gives without privileges.
    config.radar.receive_buffer_bytes = 100_000;
    Radar::new(&config).unwrap()
}

pub fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    now.as_nanos() as i64
}

/// Polls as a stage does, until `ends` or a long time is over.
pub fn poll(
    radar: &mut Radar,
    mut sweep: impl FnMut(&Sweep, i64),
    mut ends: impl FnMut(&Radar) -> bool,
) {
    let deadline = Instant::now() + Duration::from_secs(60);
    while !ends(radar) {
        assert!(
            Instant::now() < deadline,
            "{:?} {:?}",
            radar.link(),
            radar.counters()
        );
        let at_ns = now_ns();
        radar.poll(at_ns, &mut |whole| sweep(whole, at_ns));
        std::thread::sleep(Duration::from_micros(300));
    }
}

pub fn count(counters: &[Count], name: &str) -> u64 {
    counters
        .iter()
        .find(|count| count.name == name)
        .unwrap_or_else(|| panic!("no {name}"))
        .value
}

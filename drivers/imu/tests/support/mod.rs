//! A log, an emulator that plays it, and a driver that is polled as its process does.
#![allow(dead_code, reason = "not every test uses all of it")]

use randt_config::{Config, ImuSource};
use randt_emulator::imu::{ImuMeasurements, LineSender, SerialImu, SerialProtocol};
use randt_emulator::{Fault, Faults, Pace, Recording};
use randt_imu::Imu;
use randt_log::{LogFile, Options};
use randt_messages::{ImuSample, ImuSampleTopic, MessageRef, Twist, TwistTopic};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Waiting for something takes this time before the test fails.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A folder with a log of a minute of an IMU that turns slowly, 250 Hz, and of wheels, 50 Hz.
pub struct Drive {
    folder: tempfile::TempDir,
}

impl Drive {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut log =
            LogFile::create(&folder.path().join("drive.mcap"), Options::default()).unwrap();
        for i in 0..15_000_i64 {
            let mut sample = ImuSample {
                rate_rad_s: [0.01, -0.02, 0.25],
                acceleration_m_s2: [0.1, 0.2, 9.8],
                ..ImuSample::default()
            };
            sample.header.stamp_ns = 7_000_000_000 + i * 4_000_000;
            let (head, items) = (&sample, &[]);
            log.write(MessageRef::<ImuSampleTopic> { head, items })
                .unwrap();
            if i % 5 == 0 {
                let mut twist = Twist {
                    velocity: [0.5, 0.0, 0.25],
                    ..Twist::default()
                };
                twist.covariance[0] = 0.0625;
                twist.header.stamp_ns = sample.header.stamp_ns + 1_000_000;
                let (head, items) = (&twist, &[]);
                log.write(MessageRef::<TwistTopic> { head, items }).unwrap();
            }
        }
        log.finish().unwrap();
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn measurements(&self, faults: &[&str], seed: u64) -> ImuMeasurements {
        let faults: Vec<Fault> = faults.iter().map(|text| text.parse().unwrap()).collect();
        let recording = Recording::open(&self.path("drive.mcap"), true).unwrap();
        let pace = Pace::new(recording.begin_ns(), None);
        let faults = Faults::new(faults).seeded(seed);
        let measurements = ImuMeasurements::new(recording, pace, faults);
        let log = self.path("drive.mcap");
        measurements.with_twists(&log, true).unwrap()
    }

    /// Sends lines as datagrams.
    pub fn lines(&self, to: SocketAddr, faults: &[&str]) -> Emulated {
        let mut sender = LineSender::open(to).unwrap();
        let mut measurements = self.measurements(faults, 1);
        Emulated::new(move |ends| sender.run(&mut measurements, ends).unwrap())
    }

    /// Plugs a serial IMU in; its port is the link `imu`.
    pub fn serial(&self, protocol: SerialProtocol, faults: &[&str]) -> Emulated {
        self.serial_seeded(protocol, faults, 1)
    }

    /// The same, with what is random in the faults drawn by a seed.
    pub fn serial_seeded(&self, protocol: SerialProtocol, faults: &[&str], seed: u64) -> Emulated {
        let mut imu = SerialImu::open(protocol, Some(&self.path("imu"))).unwrap();
        let mut measurements = self.measurements(faults, seed);
        Emulated::new(move |ends| imu.run(&mut measurements, ends).unwrap())
    }

    /// The configuration of a driver of the port `imu`.
    pub fn config(&self, source: ImuSource) -> Config {
        let mut config = Config::default();
        config.imu.source = source;
        config.imu.device = self.path("imu").display().to_string();
        config
    }
}

/// An emulator in a thread, until it is dropped.
pub struct Emulated {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Emulated {
    pub fn new(run: impl FnOnce(&dyn Fn() -> bool) + Send + 'static) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&ends);
        let thread = std::thread::spawn(move || run(&|| asked.load(Ordering::Relaxed)));
        Self {
            ends,
            thread: Some(thread),
        }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking());
        }
    }
}

/// A driver, and what it gave.
pub struct Driven {
    pub imu: Imu,
    pub samples: Vec<ImuSample>,
    pub twists: Vec<Twist>,
    /// Every text of its link, with when it came.
    pub texts: Vec<(Instant, String)>,
    pub polls: u64,
}

impl Driven {
    pub fn new(config: &Config) -> Self {
        Self {
            imu: Imu::new(config).unwrap(),
            samples: Vec::new(),
            twists: Vec::new(),
            texts: Vec::new(),
            polls: 0,
        }
    }

    /// Polls once, then sleeps until the driver wants to be polled, or for a tenth of a second.
    pub fn step(&mut self) {
        let samples = &mut self.samples;
        self.imu
            .poll_by(&now_ns, &mut |sample| samples.push(*sample));
        self.twists.extend(self.imu.drain_twists());
        self.polls += 1;
        let text = self.imu.link().text();
        if self.texts.last().is_none_or(|(_, last)| last != text) {
            self.texts.push((Instant::now(), text.to_owned()));
        }
        let pause_ns = (self.imu.due_ns().saturating_sub(now_ns())).clamp(0, 100_000_000);
        let pause = Timespec {
            tv_sec: 0,
            tv_nsec: pause_ns,
        };
        let descriptors = [self.imu.descriptor(), self.imu.twist_descriptor()];
        let descriptors = descriptors.iter().flatten();
        let mut on: Vec<PollFd<'_>> = descriptors
            .map(|fd| PollFd::new(fd, PollFlags::IN))
            .collect();
        let _ = poll(&mut on, Some(&pause));
    }

    /// Goes on until something holds; fails with what was seen where it never does.
    pub fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !holds(self) {
            self.step();
            assert!(
                begin.elapsed() < PATIENCE,
                "{what}: {} samples, skew {}, {:?}, {:?}",
                self.samples.len(),
                self.imu.skew(),
                self.texts,
                self.imu.counters()
            );
        }
    }

    pub fn go_on(&mut self, duration: Duration) {
        let begin = Instant::now();
        while begin.elapsed() < duration {
            self.step();
        }
    }

    pub fn until_text(&mut self, text: &str) {
        self.until(text, |driven| driven.imu.link().text().contains(text));
    }

    pub fn until_samples(&mut self, more: usize) {
        let enough = self.samples.len() + more;
        self.until("samples", |driven| driven.samples.len() >= enough);
    }

    pub fn count(&self, name: &str) -> u64 {
        let counters = self.imu.counters();
        counters
            .iter()
            .find(|count| count.name == name)
            .unwrap()
            .value
    }
}

pub fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    i64::try_from(now.as_nanos()).unwrap()
}

pub fn write(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap();
}

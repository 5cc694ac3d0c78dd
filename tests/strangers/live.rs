//! A pipeline whose radar's wire is attacked while it runs.

use crate::support::names;
use crate::support::pipeline::{Pipeline, until};
use crate::support::sensors::{Emulator, Sensors};
use crate::support::stages::program;
use randt_log::LogReader;
use randt_messages::health::text_of;
use randt_messages::{OdometryStateTopic, StageHealthTopic, Trust};
use randt_radar::beam_udp::packet::{CLOCKWISE, Format, Packet};
use rustix::process::Signal;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A stranger that sends whole sweeps of the radar's device number from another address of this
/// host, until it is ended.
pub(super) fn attack(to: &str, ends: &AtomicBool) {
    let socket = UdpSocket::bind("127.0.0.2:0").unwrap();
    let mut number = 0_u32;
    while !ends.load(Ordering::Relaxed) {
        for beam in 0..220_u16 {
            let packet = Packet {
                format: Format::Sparse,
                device: 1,
                sweep: number,
                beam,
                beams: 220,
                fragment: 0,
                fragments: 1,
                first_bin: 0,
                flags: CLOCKWISE,
                azimuth: (u64::from(beam) * (1 << 32) / 220) as u32,
                device_ns: 0,
                resolution_um: 16_100,
                offset_um: 0,
                values: &[100, 0, 200, 0],
            };
            let mut bytes = Vec::new();
            packet.encode(&mut bytes);
            let _ = socket.send_to(&bytes, to);
            std::thread::sleep(Duration::from_micros(850));
        }
        number += 1;
    }
}

/// When a log first has the warning in the radar's health, and a state that is not good, s after
/// an instant.
pub(super) fn recorded_after(folder: &Path, begin_ns: i64) -> (Option<f64>, Option<f64>) {
    let (mut output, mut doubted) = (None, None);
    for name in names(folder) {
        let mut log = LogReader::open(&folder.join(name)).unwrap();
        while let Some(entry) = log.next_entry().unwrap() {
            let after_s = (entry.stamp_ns() - begin_ns) as f64 * 1e-9;
            if after_s < 0.0 {
                continue;
            }
            if let Some(health) = entry.decode::<StageHealthTopic>().unwrap()
                && text_of(&health.head.message).contains("sweeps of two senders")
            {
                output.get_or_insert(after_s);
            }
            if let Some(state) = entry.decode::<OdometryStateTopic>().unwrap()
                && state.head.trust() != Trust::Good
            {
                doubted.get_or_insert(after_s);
            }
        }
    }
    (output, doubted)
}

/// Ends an attack when it is dropped, a panic included: the scope waits for its threads.
pub(super) struct Ending<'a>(pub(super) &'a AtomicBool);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A pipeline from the radar's driver to the log, without an IMU; the radar plays a log for ever.
pub(super) struct Live {
    pub(super) pipeline: Pipeline,
    pub(super) address: String,
    pub(super) recorded: PathBuf,
    recorder: u32,
    _radar: Emulator,
}

impl Live {
    pub(super) fn new(folder: &Path, log: &Path, pin: bool) -> Self {
        let sensors = Sensors::new(folder, "beam-udp", "mip");
        let mut pipeline = Pipeline::new("spoof");
        let recorded = folder.join("recorded");
        let recorder = pipeline.record(&recorded, &[]);
        let mut odometry = Command::new(program("odometry"));
        pipeline.enter(&mut odometry);
        odometry.arg("--no-imu");
        pipeline.start("odometry", odometry);
        pipeline.stage("filter");
        let mut radar = Command::new(program("radar"));
        pipeline.enter(&mut radar);
        radar.arg("--robot").arg(sensors.robot());
        if pin {
            radar.args(["--set", "radar.sender=127.0.0.1"]);
            radar.args(["--set", "radar.device=1"]);
        }
        pipeline.start("radar", radar);
        let live = Self {
            address: sensors.address(),
            _radar: sensors.radar(log, &["--loop"]),
            pipeline,
            recorded,
            recorder,
        };
        until("a pose", || live.top().2 == "good");
        live
    }

    /// The radar's state and message, and odometry's trust, as `randt top` shows them.
    pub(super) fn top(&self) -> (String, String, String) {
        let ended = self.pipeline.randt(&["top", "--once", "--json"]);
        let figures: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
        let rows = figures["stages"].as_array().unwrap();
        let radar = rows.iter().find(|row| row["name"] == "radar");
        let text = |value: Option<&serde_json::Value>| {
            let text = value.and_then(serde_json::Value::as_str);
            text.unwrap_or_default().to_owned()
        };
        let of_radar = |key: &str| text(radar.and_then(|row| row.get(key)));
        let trust = text(figures["robot"].get("trust"));
        (of_radar("state"), of_radar("message"), trust)
    }

    /// Ends all; the log is whole then.
    pub(super) fn end(&mut self) {
        self.pipeline.end(self.recorder, Signal::TERM);
        self.pipeline.kill_all();
    }

    /// The 99th percentile of the time from a scan to its state, ms, from an instant on.
    pub(super) fn p99_ms(&self, from_ns: i64) -> f64 {
        let mut took_ms = Vec::new();
        for name in names(&self.recorded) {
            let mut log = LogReader::open(&self.recorded.join(name)).unwrap();
            while let Some(entry) = log.next_entry().unwrap() {
                if let Some(state) = entry.decode::<OdometryStateTopic>().unwrap()
                    && state.head.header.stamp_ns > from_ns
                {
                    let (end_ns, begin_ns) =
                        (state.head.header.published_ns, state.head.scan_published_ns);
                    took_ms.push((end_ns - begin_ns) as f64 * 1e-6);
                }
            }
        }
        took_ms.sort_by(f64::total_cmp);
        println!(
            "{} states, median {:.3} ms",
            took_ms.len(),
            took_ms[took_ms.len() / 2]
        );
        took_ms[took_ms.len() * 99 / 100]
    }
}

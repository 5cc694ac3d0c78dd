//! An IMU on a serial port.
//!
//! Responsible for when the port is opened, configured, read and given up: opened by its
//! configured path, so that a device is found again under another number; closed before it is
//! opened again; patient with what is not there; opened anew when it is silent. Not responsible
//! for the protocol's bytes.

use crate::port::{KERNEL_BUFFER, Port};
use crate::protocol::{Codec, Framed};
use crate::{Reading, reading_source::ReadingSource};
use randt_config::ImuDriver;
use randt_device::{Backoff, Count};
use std::os::fd::BorrowedFd;
use std::path::PathBuf;

/// A device that is configured, or that does not answer, may need this long to its first reading.
const SETTLING_NS: i64 = 1_500_000_000;
/// Reads in a row, so that a device that never stops cannot hold the driver.
const READS_MAX: usize = 16;

/// An IMU on a serial port.
#[derive(Debug)]
pub struct Serial<C: Codec> {
    path: PathBuf,
    baud: u32,
    protocol: Framed<C>,
    patience_ns: i64,
    port: Option<Port>,
    backoff: Backoff,
    fault: String,
    /// When the port was opened, the last reading came, or the device last answered its setup.
    active_ns: i64,
    session: Session,
    opened: u64,
    overruns: u64,
    buffer: Vec<u8>,
}

/// What is known since the port was opened.
#[derive(Debug, Default)]
struct Session {
    bytes: u64,
    /// Frames before it was opened.
    frames_before: u64,
}

impl<C: Codec> Serial<C> {
    /// By its configuration.
    pub fn new(config: &ImuDriver) -> Self {
        Self {
            path: PathBuf::from(&config.device),
            baud: config.baud,
            protocol: Framed::new(config.rate_hz),
            patience_ns: ((config.silence_s * 1e9) as i64).max(SETTLING_NS),
            port: None,
            backoff: Backoff::default(),
            fault: String::new(),
            active_ns: 0,
            session: Session::default(),
            opened: 0,
            overruns: 0,
            buffer: vec![0; KERNEL_BUFFER],
        }
    }

    fn open(&mut self, now_ns: i64) {
        match Port::open(&self.path, self.baud) {
            Ok(port) => {
                self.port = Some(port);
                self.protocol.opened();
                self.fault.clear();
                self.active_ns = now_ns;
                self.session = Session {
                    bytes: 0,
                    frames_before: self.protocol.counts().frames,
                };
                self.opened += 1;
            }
            Err(why) => self.gone(now_ns, why),
        }
    }

    fn gone(&mut self, now_ns: i64, why: String) {
        self.port = None;
        self.fault = why;
        self.backoff.failed(now_ns);
    }

    /// Whether the port is still good.
    fn read(
        &mut self,
        clock: &dyn Fn() -> i64,
        readings: &mut Vec<Reading>,
    ) -> std::io::Result<()> {
        let Some(port) = self.port.as_mut() else {
            return Ok(());
        };
        let before = readings.len();
        for _ in 0..READS_MAX {
            let Some(count) = port.read(&mut self.buffer)? else {
                break;
            };
            self.session.bytes += count as u64;
            // One byte is the kernel's own.
            self.overruns += u64::from(count + 1 >= KERNEL_BUFFER);
            let bytes = self.buffer.get(..count).unwrap_or_default();
            self.protocol.take(bytes, clock(), readings);
        }
        let now_ns = clock();
        if readings.len() > before {
            self.active_ns = now_ns;
            self.backoff.succeeded();
        } else if self.protocol.is_under_way() {
            self.active_ns = now_ns;
        }
        while let Some(command) = self.protocol.send(now_ns) {
            port.write(&command)?;
        }
        Ok(())
    }
}

impl<C: Codec> ReadingSource for Serial<C> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.port.as_ref().map(Port::descriptor)
    }

    fn poll(&mut self, clock: &dyn Fn() -> i64, readings: &mut Vec<Reading>) {
        let now_ns = clock();
        if self.port.is_none() && self.backoff.is_due(now_ns) {
            self.open(now_ns);
        }
        if let Err(error) = self.read(clock, readings) {
            let why = format!("{}: unplugged ({error})", self.path.display());
            self.gone(now_ns, why);
        } else if self.port.is_some() && now_ns - self.active_ns > self.patience_ns {
            // It is there, so there is nothing to be patient with.
            self.port = None;
            self.open(now_ns);
        }
    }

    fn due_ns(&self) -> Option<i64> {
        if self.port.is_none() {
            return Some(self.backoff.due_ns());
        }
        let silent_ns = self.active_ns.saturating_add(self.patience_ns);
        let due_ns = self.protocol.due_ns().unwrap_or(i64::MAX);
        Some(due_ns.min(silent_ns))
    }

    fn fault(&self) -> &str {
        &self.fault
    }

    fn silence(&self) -> String {
        let path = self.path.display();
        if self.protocol.counts().frames > self.session.frames_before {
            format!("{path}: answers, but no sample")
        } else if self.session.bytes > 0 {
            format!(
                "{path}: bytes that are not of this protocol; are imu.source and imu.baud right?"
            )
        } else {
            format!("{path}: no sample")
        }
    }

    fn complaint(&self) -> &str {
        self.protocol.complaint()
    }

    fn interval_ns(&self) -> i64 {
        self.protocol.interval_ns()
    }

    fn reconnects(&self) -> u64 {
        self.opened.saturating_sub(1)
    }

    fn counts(&self) -> Vec<Count> {
        let counts = self.protocol.counts();
        vec![
            Count::event("frames", counts.frames),
            Count::event("checksum_errors", counts.checksum_errors),
            Count::event("junk_bytes", counts.junk_bytes),
            Count::loss("overruns", self.overruns),
        ]
    }
}

//! Lines as readings and velocities.
//!
//! Responsible for when the wire is opened, read and given up, and for whose lines are used. Not
//! responsible for what a line means.

use super::wire::{Piece, Wire};
use super::{LineDecoder, LineMessage, TwistLine};
use crate::port::KERNEL_BUFFER;
use crate::protocol::interval_ns;
use crate::{Reading, reading_source::ReadingSource};
use randt_config::{ImuDriver, SenderPin};
use randt_device::{Backoff, Count};
use std::os::fd::BorrowedFd;

/// A device begins to send within this time after its port was opened; many begin anew then, ns.
const SETTLING_NS: i64 = 1_500_000_000;
/// Reads in a row, so that a sender that never stops cannot hold the driver.
const READS_MAX: usize = 64;

/// A velocity as it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistReading {
    /// What the line says.
    pub line: TwistLine,
    /// When it reached the host, ns.
    pub arrival_ns: i64,
}

/// A wire of lines. Its fields are the wire, what is read from it, and when.
#[derive(Debug)]
pub(crate) struct LineSource {
    wire: Wire,
    /// The key that says whose datagrams are used.
    sender_key: &'static str,
    decoder: LineDecoder,
    interval_ns: i64,
    patience_ns: i64,
    backoff: Backoff,
    fault: String,
    complaint: String,
    /// When it was opened, or the last line came, ns.
    active_ns: i64,
    session: Session,
    reconnects: u64,
    /// Reads that found the serial port's buffer full: what did not fit is missing.
    overruns: u64,
    twists: Vec<TwistReading>,
    buffer: Vec<u8>,
}

/// What is known since the wire was opened.
#[derive(Debug, Default)]
struct Session {
    has_begun: bool,
    bytes: u64,
    lines_before: u64,
}

impl LineSource {
    /// The IMU's wire.
    pub fn of_imu(config: &ImuDriver) -> Self {
        Self::new(config, &config.device, config.sender, "imu.sender")
    }

    /// The wire of the velocity's own; none where the configuration has none.
    pub fn of_twists(config: &ImuDriver) -> Option<Self> {
        let device = &config.twist_device;
        let sender = config.twist_sender;
        (!device.is_empty()).then(|| Self::new(config, device, sender, "imu.twist_sender"))
    }

    fn new(config: &ImuDriver, device: &str, sender: SenderPin, sender_key: &'static str) -> Self {
        let silence_ns = (config.silence_s * 1e9) as i64;
        Self {
            wire: Wire::new(device, config.baud, sender, silence_ns),
            sender_key,
            decoder: LineDecoder::default(),
            interval_ns: interval_ns(config.rate_hz),
            patience_ns: silence_ns.max(SETTLING_NS),
            backoff: Backoff::default(),
            fault: String::new(),
            complaint: String::new(),
            active_ns: 0,
            session: Session::default(),
            reconnects: 0,
            overruns: 0,
            twists: Vec::new(),
            buffer: vec![0; KERNEL_BUFFER],
        }
    }

    fn open(&mut self, now_ns: i64) {
        match self.wire.open() {
            Ok(()) => {
                if self.wire.senders().is_none() {
                    self.decoder.opened();
                }
                self.fault.clear();
                self.active_ns = now_ns;
                self.reconnects += u64::from(self.session.has_begun);
                self.session = Session {
                    has_begun: true,
                    bytes: 0,
                    lines_before: self.decoder.lines(),
                };
            }
            Err(why) => self.gone(now_ns, why),
        }
    }

    fn gone(&mut self, now_ns: i64, why: String) {
        self.wire.close();
        self.fault = why;
        self.backoff.failed(now_ns);
    }

    fn read(
        &mut self,
        clock: &dyn Fn() -> i64,
        readings: &mut Vec<Reading>,
    ) -> std::io::Result<()> {
        for _ in 0..READS_MAX {
            let Some(piece) = self.wire.read(&mut self.buffer)? else {
                break;
            };
            let now_ns = clock();
            if self.take(piece, now_ns, readings) {
                self.active_ns = now_ns;
                self.backoff.succeeded();
            }
        }
        Ok(())
    }

    /// Takes a piece; whether there was a line in it.
    fn take(&mut self, piece: Piece, arrival_ns: i64, readings: &mut Vec<Reading>) -> bool {
        let before = (readings.len(), self.twists.len());
        let twists = &mut self.twists;
        let mut sink = |message| match message {
            LineMessage::Imu(imu) => readings.push(Reading {
                device_ns: imu.stamp_ns,
                counter: imu.sequence,
                arrival_ns,
                rate_rad_s: imu.rate_rad_s,
                acceleration_m_s2: imu.acceleration_m_s2,
            }),
            LineMessage::Twist(line) => twists.push(TwistReading { line, arrival_ns }),
        };
        match piece {
            Piece::Stream(count) => {
                self.session.bytes += count as u64;
                // One byte is the kernel's own.
                self.overruns += u64::from(count + 1 >= KERNEL_BUFFER);
                let bytes = self.buffer.get(..count).unwrap_or_default();
                self.decoder.stream(bytes, &mut sink);
            }
            Piece::Datagram(count, from) => {
                let Some(senders) = self.wire.senders() else {
                    return false;
                };
                if !senders.allows(from, arrival_ns) {
                    return false;
                }
                let begins_anew = senders.begins_anew(from, arrival_ns);
                if begins_anew {
                    self.decoder.restart();
                }
                self.session.bytes += count as u64;
                let lines = self.decoder.lines();
                let bytes = self.buffer.get(..count).unwrap_or_default();
                self.decoder.datagram(bytes, &mut sink);
                if self.decoder.lines() > lines {
                    senders.take(from, arrival_ns);
                    self.reconnects += u64::from(begins_anew);
                }
            }
        }
        before != (readings.len(), self.twists.len())
    }

    /// Twists that did not come, by their numbers.
    pub fn twists_lost(&self) -> u64 {
        self.decoder.twists_lost()
    }
}

impl ReadingSource for LineSource {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.wire.descriptor()
    }

    fn poll(&mut self, clock: &dyn Fn() -> i64, readings: &mut Vec<Reading>) {
        let now_ns = clock();
        if !self.wire.is_open() && self.backoff.is_due(now_ns) {
            self.open(now_ns);
        }
        if let Err(error) = self.read(clock, readings) {
            let why = match self.wire {
                Wire::Serial { .. } => format!("{}: unplugged ({error})", self.wire),
                Wire::Udp { .. } => format!("{}: {}; opening it anew", self.wire, error.kind()),
            };
            return self.gone(now_ns, why);
        }
        let is_stream = self.wire.senders().is_none();
        if is_stream && self.wire.is_open() && now_ns - self.active_ns > self.patience_ns {
            // It is there, so there is nothing to be patient with.
            self.open(now_ns);
        }
        let two = self.wire.senders().and_then(|senders| senders.two(now_ns));
        self.complaint = match two {
            None => String::new(),
            Some([taken, other]) => {
                let key = self.sender_key;
                format!("{taken} and {other} send, the second is left out: set {key}")
            }
        };
    }

    fn due_ns(&self) -> Option<i64> {
        match self.wire {
            _ if !self.wire.is_open() => Some(self.backoff.due_ns()),
            Wire::Serial { .. } => Some(self.active_ns.saturating_add(self.patience_ns)),
            // The next datagram wakes.
            Wire::Udp { .. } => None,
        }
    }

    fn fault(&self) -> &str {
        &self.fault
    }

    fn silence(&self) -> String {
        let wire = &self.wire;
        if self.decoder.lines() > self.session.lines_before {
            format!("{wire}: lines, but no sample")
        } else if self.session.bytes > 0 {
            format!("{wire}: bytes that are no lines of docs/lines.md; is imu.baud right?")
        } else if self.wire.refused().is_some_and(|refused| refused > 0) {
            format!(
                "{wire}: datagrams of others only; is {} right?",
                self.sender_key
            )
        } else {
            format!("{wire}: no line")
        }
    }

    fn complaint(&self) -> &str {
        &self.complaint
    }

    fn interval_ns(&self) -> i64 {
        self.interval_ns
    }

    fn reconnects(&self) -> u64 {
        self.reconnects
    }

    fn counts(&self) -> Vec<Count> {
        let mut counts = self.decoder.counts();
        if matches!(self.wire, Wire::Serial { .. }) {
            counts.push(Count::loss("overruns", self.overruns));
        }
        let refused = self.wire.refused();
        counts.extend(refused.map(|refused| Count::event("datagrams_of_another_sender", refused)));
        counts
    }

    fn drain_twists(&mut self, sink: &mut dyn FnMut(TwistReading)) {
        self.twists.drain(..).for_each(sink);
    }
}

//! A serial IMU on a pseudo-terminal.
//!
//! Responsible for the port's faults: bytes that are wrong, late, missing or too many, and a port
//! that goes and comes back under another name. Not responsible for the protocol's bytes.

use super::device::Device;
use super::line::LineDevice;
use super::mip::MipDevice;
use super::terminal::{Terminal, link};
use super::xsens::XsensDevice;
use super::{ImuMeasurement, ImuMeasurements};
use crate::pace::wait;
use crate::wrong_content::WrongContent;
use crate::{Error, FaultKind};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

/// A device answers within this time.
const ANSWER: Duration = Duration::from_millis(2);
/// Fifty bytes, a message, take this time at 921,600 baud: an emulator that was kept from sending
/// does not send all that it is late with at once, which no port's buffer would hold.
const ON_THE_WIRE: Duration = Duration::from_micros(500);
/// One of this many messages is corrupted.
const CORRUPTED_EVERY: u64 = 10;
/// Junk has a signature's first byte in it, as noise may.
const JUNK: &[u8] = &[0x75, 0x00, 0xFA, 0xFF, 0x75, 0x65, 0x13];

/// The protocol of a serial IMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialProtocol {
    /// MicroStrain MIP.
    Mip,
    /// Xsens MTData2.
    Xsens,
    /// Text lines.
    Line,
}

impl SerialProtocol {
    fn device(self) -> Box<dyn Device> {
        match self {
            Self::Mip => Box::<MipDevice>::default(),
            Self::Xsens => Box::<XsensDevice>::default(),
            Self::Line => Box::<LineDevice>::default(),
        }
    }
}

/// A serial IMU.
pub struct SerialImu {
    protocol: SerialProtocol,
    link: Option<PathBuf>,
    plugged: Option<Plugged>,
}

struct Plugged {
    terminal: Terminal,
    device: Box<dyn Device>,
    /// What is on its way, while messages arrive in pieces.
    held: Vec<u8>,
}

impl Plugged {
    fn new(protocol: SerialProtocol) -> Result<Self, Error> {
        Ok(Self {
            terminal: Terminal::open()?,
            device: protocol.device(),
            held: Vec::new(),
        })
    }

    fn answer(&mut self, silent: bool) {
        let commands = self.terminal.read();
        if !silent && !commands.is_empty() {
            let answers = self.device.take(&commands);
            self.terminal.write(&answers);
        }
    }
}

impl SerialImu {
    /// Plugs it in: the port is `link`, or else [`Self::path`].
    pub fn open(protocol: SerialProtocol, link: Option<&Path>) -> Result<Self, Error> {
        let mut imu = Self {
            protocol,
            link: link.map(Path::to_owned),
            plugged: None,
        };
        imu.plug()?;
        Ok(imu)
    }

    /// The port; without a link another one after each time that it was unplugged.
    pub fn path(&self) -> Option<&Path> {
        let plugged = self.plugged.as_ref().map(|plugged| plugged.terminal.path());
        self.link.as_deref().or(plugged)
    }

    fn plug(&mut self) -> Result<(), Error> {
        let plugged = Plugged::new(self.protocol)?;
        if let Some(path) = &self.link {
            link(path, plugged.terminal.path())?;
        }
        self.plugged = Some(plugged);
        Ok(())
    }

    fn unplug(&mut self) {
        self.plugged = None;
        if let Some(path) = &self.link {
            let _ = std::fs::remove_file(path);
        }
    }

    /// Plays all measurements, or until the end is asked for.
    pub fn run(
        &mut self,
        measurements: &mut ImuMeasurements,
        ends: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        let mut closed = 0;
        let mut wrong = WrongContent::new(measurements.faults().seed());
        while let Some(measurement) = measurements.next_measurement()? {
            let at_s = measurements.at_s(measurement.stamp_ns);
            let on = |kind| measurements.faults().is_on(kind, at_s);
            let (unplugged, silent) = (on(FaultKind::Unplug), on(FaultKind::Silence));
            let is_wrong = on(FaultKind::Wrong);
            let close = measurements.faults().begun(FaultKind::Close, at_s) > closed;
            let due = measurements.pace().due(measurement.stamp_ns);
            let plugged = &mut self.plugged;
            let answer = || plugged.iter_mut().for_each(|it| it.answer(silent));
            if !wait(due, ANSWER, ends, answer) {
                break;
            }
            if unplugged {
                self.unplug();
                continue;
            }
            if self.plugged.is_none() {
                self.plug()?;
                measurements.begin_clock(measurement.stamp_ns);
            }
            if is_wrong
                && measurement.number.is_multiple_of(CORRUPTED_EVERY)
                && let Some(plugged) = &mut self.plugged
            {
                let message = plugged.device.wrong(&measurement, &mut wrong);
                plugged.terminal.write(&message);
            }
            if close {
                closed += 1;
                self.send(&measurement, measurements, true);
                self.plug()?;
            } else if !silent && !measurements.is_lost(&measurement) {
                self.send(&measurement, measurements, false);
            }
            while let Some((number, device_ns, twist)) = measurements.next_twist()? {
                if let Some(plugged) = self.plugged.as_mut().filter(|_| !silent) {
                    let message = plugged.device.twist(number, device_ns, &twist);
                    plugged.held.extend(message.unwrap_or_default());
                }
            }
        }
        self.unplug();
        Ok(())
    }

    fn send(&mut self, measurement: &ImuMeasurement, measurements: &ImuMeasurements, half: bool) {
        let Some(plugged) = &mut self.plugged else {
            return;
        };
        let interval_ns = measurements.interval_ns();
        let Some(mut message) = plugged.device.message(measurement, interval_ns) else {
            return;
        };
        let at_s = measurements.at_s(measurement.stamp_ns);
        let on = |kind| measurements.faults().is_on(kind, at_s);
        let corrupted = |kind| on(kind) && measurement.number.is_multiple_of(CORRUPTED_EVERY);
        if corrupted(FaultKind::Checksum) {
            plugged.device.damage(&mut message);
        }
        if half || corrupted(FaultKind::Cut) {
            message.truncate(message.len() / 2);
        }
        let mut bytes = Vec::new();
        if corrupted(FaultKind::Junk) {
            bytes.extend_from_slice(JUNK);
        }
        if corrupted(FaultKind::Oversize) {
            bytes.extend_from_slice(plugged.device.oversize());
        }
        bytes.extend(message);
        if corrupted(FaultKind::Doubled) {
            bytes.extend_from_within(..);
        }
        plugged.held.extend(bytes);
        // Half of what is on its way stays there, so that messages are split and merged.
        let now = match on(FaultKind::Split) {
            true => plugged.held.len().div_ceil(2),
            false => plugged.held.len(),
        };
        let bytes: Vec<u8> = plugged.held.drain(..now).collect();
        plugged.terminal.write(&bytes);
        thread::sleep(ON_THE_WIRE);
    }
}

impl Drop for SerialImu {
    fn drop(&mut self) {
        self.unplug();
    }
}

//! A serial IMU on a pseudo-terminal.
//!
//! Responsible for the port's faults: bytes that are wrong, late, missing or too many, and a port that goes and comes
//! back under another name. Not responsible for the protocol's bytes.

use super::device::Device;
use super::mip::MipDevice;
use super::terminal::{Terminal, link};
use super::xsens::XsensDevice;
use super::{Moment, Moments};
use crate::wrong::Wrong;
use crate::{Error, FaultKind};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

/// A device answers within this time.
const ANSWER: Duration = Duration::from_millis(2);
/// Fifty bytes, a message, take so long at 921,600 baud: an emulator that was kept from sending does not send all that it
/// is late with at once, which no port's buffer would hold.
const ON_THE_WIRE: Duration = Duration::from_micros(500);
/// Every so many messages one is corrupted.
const CORRUPTED_EVERY: u64 = 10;
/// Junk has a signature's first byte in it, as noise may.
const JUNK: &[u8] = &[0x75, 0x00, 0xFA, 0xFF, 0x75, 0x65, 0x13];

/// What a serial IMU speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialProtocol {
    /// MicroStrain MIP.
    Mip,
    /// Xsens MTData2.
    Xsens,
}

impl SerialProtocol {
    fn device(self) -> Box<dyn Device> {
        match self {
            Self::Mip => Box::<MipDevice>::default(),
            Self::Xsens => Box::<XsensDevice>::default(),
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
    /// Plugs it in: the port is `link`, or else what [`Self::path`] says.
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

    /// Plays all moments, or until the end is asked for.
    pub fn run(&mut self, moments: &mut Moments, ends: &dyn Fn() -> bool) -> Result<(), Error> {
        let mut closed = 0;
        let mut wrong = Wrong::new(moments.faults().seed());
        while let Some(moment) = moments.next_moment()? {
            let at_s = moments.at_s(moment.stamp_ns);
            let on = |kind| moments.faults().is_on(kind, at_s);
            let (unplugged, silent) = (on(FaultKind::Unplug), on(FaultKind::Silence));
            let is_wrong = on(FaultKind::Wrong);
            let close = moments.faults().begun(FaultKind::Close, at_s) > closed;
            if !self.wait(moments.pace().due(moment.stamp_ns), silent, ends) {
                break;
            }
            if unplugged {
                self.unplug();
                continue;
            }
            if self.plugged.is_none() {
                self.plug()?;
                moments.begin_clock(moment.stamp_ns);
            }
            if is_wrong
                && moment.number.is_multiple_of(CORRUPTED_EVERY)
                && let Some(plugged) = &mut self.plugged
            {
                let message = plugged.device.wrong(&moment, &mut wrong);
                plugged.terminal.write(&message);
            }
            if close {
                closed += 1;
                self.send(&moment, moments, true);
                self.plug()?;
            } else if !silent && !moments.is_lost(&moment) {
                self.send(&moment, moments, false);
            }
        }
        self.unplug();
        Ok(())
    }

    /// Sleeps until something is due, and answers meanwhile.
    fn wait(&mut self, due: Instant, silent: bool, ends: &dyn Fn() -> bool) -> bool {
        loop {
            if let Some(plugged) = &mut self.plugged {
                plugged.answer(silent);
            }
            let pause = due.saturating_duration_since(Instant::now());
            if pause.is_zero() || ends() {
                return pause.is_zero();
            }
            thread::sleep(pause.min(ANSWER));
        }
    }

    fn send(&mut self, moment: &Moment, moments: &Moments, half: bool) {
        let Some(plugged) = &mut self.plugged else {
            return;
        };
        let Some(mut message) = plugged.device.message(moment, moments.interval_ns()) else {
            return;
        };
        let at_s = moments.at_s(moment.stamp_ns);
        let on = |kind| moments.faults().is_on(kind, at_s);
        let corrupted = |kind| on(kind) && moment.number.is_multiple_of(CORRUPTED_EVERY);
        if corrupted(FaultKind::Checksum)
            && let Some(last) = message.last_mut()
        {
            *last ^= 0x55;
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
        if on(FaultKind::Doubled) && moment.number.is_multiple_of(CORRUPTED_EVERY) {
            bytes.extend_from_within(..);
        }
        plugged.held.extend(bytes);
        // Half of what is on its way stays there, so that messages are split and merged.
        let keep = if on(FaultKind::Split) {
            plugged.held.len() / 2
        } else {
            0
        };
        let now = plugged.held.len() - keep;
        plugged
            .terminal
            .write(plugged.held.get(..now).unwrap_or_default());
        plugged.held.drain(..now);
        thread::sleep(ON_THE_WIRE);
    }
}

impl Drop for SerialImu {
    fn drop(&mut self) {
        self.unplug();
    }
}

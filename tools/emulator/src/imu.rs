//! Emulated IMUs.
//!
//! Responsible for what all of them have in common: the log's samples at their time, the device's
//! own clock, and the faults of a device whatever its protocol. Not responsible for bytes.

mod device;
mod line;
mod mip;
mod phidget;
mod serial;
mod terminal;
mod xsens;

pub use line::LineSender;
pub use phidget::PhidgetServer;
pub use serial::{SerialImu, SerialProtocol};

use crate::{Error, FaultKind, Faults, Pace, Recording};
use randt_messages::{ImuSampleTopic, Message, Twist, TwistTopic};
use std::path::Path;

/// How fast a skewed device's clock is.
const SKEW: f64 = 200e-6;
/// One of this many samples is lost.
const LOST: u64 = 20;
/// Interval of a log of one sample, ns.
const INTERVAL_NS: i64 = 4_000_000;

/// What a device measures at one instant, in SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuMeasurement {
    /// When it is due, in the log's time, ns.
    pub stamp_ns: i64,
    /// The device's own time, ns.
    pub device_ns: i64,
    /// Number of the measurement.
    pub number: u64,
    /// rad/s.
    pub rate_rad_s: [f64; 3],
    /// m/s^2.
    pub acceleration_m_s2: [f64; 3],
}

/// The log's samples as a device measures them. Its fields are the log, the device's clock, and
/// what goes wrong.
pub struct ImuMeasurements {
    recording: Recording<ImuSampleTopic>,
    twists: Option<Twists>,
    pace: Pace,
    faults: Faults,
    number: u64,
    /// Stamp at which the device's clock began.
    zero_ns: i64,
    /// What the clock is ahead by, and up to which stamp that was computed.
    ahead_ns: f64,
    last_ns: i64,
    resets: usize,
    interval_ns: i64,
}

/// The velocities of the same log.
struct Twists {
    recording: Recording<TwistTopic>,
    /// The next one, and what is to be added to its stamp.
    next: Option<(Message<TwistTopic>, i64)>,
    number: u64,
}

impl ImuMeasurements {
    /// All samples of a recording.
    pub fn new(recording: Recording<ImuSampleTopic>, pace: Pace, faults: Faults) -> Self {
        let begin_ns = recording.begin_ns();
        Self {
            recording,
            twists: None,
            pace,
            faults,
            number: 0,
            zero_ns: begin_ns,
            ahead_ns: 0.0,
            last_ns: begin_ns,
            resets: 0,
            interval_ns: INTERVAL_NS,
        }
    }

    /// With the velocities of the same log, where it has some, for a device that sends both.
    pub fn with_twists(mut self, path: &Path, endless: bool) -> Result<Self, Error> {
        let mut recording = match Recording::open(path, endless) {
            Ok(recording) => recording,
            Err(Error::Empty { .. }) => return Ok(self),
            Err(error) => return Err(error),
        };
        let next = recording.next_message()?;
        self.twists = Some(Twists {
            recording,
            next,
            number: 0,
        });
        Ok(self)
    }

    /// The next velocity that was measured before the last measurement: its number, the device's
    /// time, ns, and itself.
    pub fn next_twist(&mut self) -> Result<Option<(u64, i64, Twist)>, Error> {
        let Some(twists) = &mut self.twists else {
            return Ok(None);
        };
        let Some((twist, shift_ns)) = &twists.next else {
            return Ok(None);
        };
        let stamp_ns = twist.head.header.stamp_ns.saturating_add(*shift_ns);
        if stamp_ns > self.last_ns {
            return Ok(None);
        }
        let device_ns = stamp_ns.saturating_sub(self.zero_ns) + self.ahead_ns as i64;
        let next = (twists.number, device_ns, *twist.head);
        twists.number += 1;
        twists.next = twists.recording.next_message()?;
        Ok(Some(next))
    }

    /// The next one; `None` at the recording's end.
    pub fn next_measurement(&mut self) -> Result<Option<ImuMeasurement>, Error> {
        let Some((sample, shift_ns)) = self.recording.next_message()? else {
            return Ok(None);
        };
        let stamp_ns = sample.head.header.stamp_ns.saturating_add(shift_ns);
        let step_ns = stamp_ns.saturating_sub(self.last_ns);
        if self.number == 1 {
            self.interval_ns = step_ns.max(1);
        }
        let at_s = self.at_s(stamp_ns);
        if self.faults.is_on(FaultKind::Skew, at_s) {
            self.ahead_ns += step_ns as f64 * SKEW;
        }
        let resets = self.faults.begun(FaultKind::ClockReset, at_s);
        if resets != self.resets {
            self.resets = resets;
            self.begin_clock(stamp_ns);
        }
        let measurement = ImuMeasurement {
            stamp_ns,
            device_ns: stamp_ns.saturating_sub(self.zero_ns) + self.ahead_ns as i64,
            number: self.number,
            rate_rad_s: sample.head.rate_rad_s,
            acceleration_m_s2: sample.head.acceleration_m_s2,
        };
        self.last_ns = stamp_ns;
        self.number += 1;
        Ok(Some(measurement))
    }

    /// The device was switched on: its clock begins at 0.
    pub fn begin_clock(&mut self, stamp_ns: i64) {
        self.zero_ns = stamp_ns;
        self.ahead_ns = 0.0;
    }

    /// Whether the device does not send this one.
    pub fn is_lost(&self, measurement: &ImuMeasurement) -> bool {
        let at_s = self.at_s(measurement.stamp_ns);
        (self.faults.is_on(FaultKind::Lost, at_s) && measurement.number.is_multiple_of(LOST))
            || (self.faults.is_on(FaultKind::Rate, at_s) && measurement.number.is_multiple_of(2))
    }

    /// From one sample to the next, ns.
    pub fn interval_ns(&self) -> i64 {
        self.interval_ns
    }

    /// A stamp as seconds since the emulator's beginning.
    pub fn at_s(&self, stamp_ns: i64) -> f64 {
        stamp_ns.saturating_sub(self.recording.begin_ns()) as f64 * 1e-9
    }

    /// What goes wrong.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// When a stamp is due.
    pub fn pace(&self) -> Pace {
        self.pace
    }
}

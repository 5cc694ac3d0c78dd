//! What a serial protocol does for its port.

use crate::command_sequence::{CommandSequence, Step};
use crate::frames::{FrameCounts, Frames, Framing};
use crate::reading::Reading;
use std::fmt::Debug;

/// What a protocol's frames and commands mean.
pub trait Codec: Debug + Sized {
    /// The form of its frames.
    type Framing: Framing + Debug + Default;
    /// What is asked of a device after its port was opened.
    type Step: Step;

    /// One whose device is asked for this many readings a second.
    fn new(rate_hz: f64) -> Self;

    /// The port was opened: the device is configured from the beginning.
    fn restart(&mut self);

    /// The command of a step, as bytes.
    fn command(&self, step: Self::Step) -> Vec<u8>;

    /// Takes a frame: a reading, or an answer to a command.
    fn take(
        &mut self,
        frame: &[u8],
        commands: &mut CommandSequence<Self::Step>,
        arrival_ns: i64,
    ) -> Option<Reading>;

    /// From one reading to the next, ns.
    fn interval_ns(&self) -> i64;
}

/// A protocol of frames and commands, without its port: bytes in, readings and commands out.
#[derive(Debug)]
pub struct Framed<C: Codec> {
    frames: Frames<C::Framing>,
    commands: CommandSequence<C::Step>,
    codec: C,
}

impl<C: Codec> Framed<C> {
    /// One whose device is asked for this many readings a second.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            frames: Frames::default(),
            commands: CommandSequence::default(),
            codec: C::new(rate_hz),
        }
    }

    /// The port was opened: half a frame is forgotten, and the device is configured again.
    pub fn opened(&mut self) {
        self.frames.cut();
        self.commands = CommandSequence::default();
        self.codec.restart();
    }

    /// Takes what was read.
    pub fn take(&mut self, bytes: &[u8], arrival_ns: i64, readings: &mut Vec<Reading>) {
        let (codec, commands) = (&mut self.codec, &mut self.commands);
        self.frames.push(bytes, &mut |frame| {
            readings.extend(codec.take(frame, commands, arrival_ns));
        });
    }

    /// A command that is to be sent now.
    pub fn send(&mut self, now_ns: i64) -> Option<Vec<u8>> {
        let step = self.commands.send(now_ns)?;
        Some(self.codec.command(step))
    }

    /// When [`Self::send`] may have something; none once the device is configured.
    pub fn due_ns(&self) -> Option<i64> {
        self.commands.due_ns()
    }

    /// Whether the device is being configured, and answers.
    pub fn is_under_way(&self) -> bool {
        self.commands.is_under_way()
    }

    /// What was counted.
    pub fn counts(&self) -> FrameCounts {
        self.frames.counts()
    }

    /// What the device refused, or an empty text.
    pub fn complaint(&self) -> &str {
        self.commands.complaint()
    }

    /// From one reading to the next, ns, as the device has agreed to, else as it is configured
    /// here.
    pub fn interval_ns(&self) -> i64 {
        self.codec.interval_ns()
    }
}

/// Nanoseconds between readings at a rate. At least one: a rate is finite and positive
/// (`imu.rate_hz`).
pub(crate) fn interval_ns(rate_hz: f64) -> i64 {
    ((1e9 / rate_hz) as i64).max(1)
}

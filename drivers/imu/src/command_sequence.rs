//! The commands that configure a device after its port was opened: one at a time, each answered or
//! given up.
//!
//! Responsible for when a command is sent and sent again, and for when all of them are. Not
//! responsible for their bytes, which are the protocol's. A device that answers nothing is not
//! silent yet: it may stream what another host configured.

use std::fmt::Debug;

/// Sent again after this time: a device at 115200 baud has hundreds of bytes of measurements to
/// send before its answer.
const RETRY_NS: i64 = 300_000_000;
/// A command is given up after this many.
const TRIES_MAX: u8 = 3;
/// All commands are sent anew at most this often to a device that acknowledges some of them and
/// not the others. It was away for a part of the sequence, or answers that were not its own ended
/// steps early; one that never knows a command must stream all the same.
const REPEATS_MAX: u8 = 2;

/// A step of the sequence: one command.
pub trait Step: Copy + Debug + PartialEq {
    /// The first one.
    const FIRST: Self;

    /// The one that follows, by whether this one was acknowledged; none after the last.
    fn next(self, acknowledged: bool) -> Option<Self>;
}

/// Where in its commands a device is.
#[derive(Clone, Debug)]
pub struct CommandSequence<S> {
    step: Option<S>,
    tries: u8,
    retry_ns: i64,
    repeats: u8,
    /// Whether the device has answered since the first command was sent.
    answers: bool,
    /// Whether every command since the first was acknowledged, or has one in its stead.
    is_complete: bool,
    complaint: String,
}

impl<S: Step> Default for CommandSequence<S> {
    fn default() -> Self {
        Self {
            step: Some(S::FIRST),
            tries: 0,
            retry_ns: i64::MIN,
            repeats: 0,
            answers: false,
            is_complete: true,
            complaint: String::new(),
        }
    }
}

impl<S: Step> CommandSequence<S> {
    /// The step whose answer is waited for; none once the device is configured.
    pub fn step(&self) -> Option<S> {
        self.step
    }

    /// When there may be something to send; none once the device is configured.
    pub fn due_ns(&self) -> Option<i64> {
        self.step.map(|_| self.retry_ns)
    }

    /// Whether the device answers and is not configured yet.
    pub fn is_under_way(&self) -> bool {
        self.step.is_some() && self.answers
    }

    /// The step whose command is to be sent now.
    pub fn send(&mut self, now_ns: i64) -> Option<S> {
        if self.step.is_none() || now_ns < self.retry_ns {
            return None;
        }
        if self.tries == TRIES_MAX {
            self.is_complete = false;
            self.go_on(false);
        }
        self.tries += 1;
        self.retry_ns = now_ns.saturating_add(RETRY_NS);
        self.step
    }

    /// The device has done what it was asked.
    pub fn acknowledge(&mut self) {
        self.answers = true;
        self.go_on(true);
    }

    /// The device refuses, and the next command is in this one's stead.
    pub fn replace(&mut self) {
        self.answers = true;
        self.go_on(false);
    }

    /// The device refuses, and that is worth a complaint.
    pub fn refuse(&mut self, complaint: String) {
        self.complaint = complaint;
        self.is_complete = false;
        self.replace();
    }

    fn go_on(&mut self, acknowledged: bool) {
        (self.tries, self.retry_ns) = (0, i64::MIN);
        self.step = self.step.and_then(|step| step.next(acknowledged));
        if self.step.is_none() && self.answers && !self.is_complete && self.repeats < REPEATS_MAX {
            *self = Self {
                repeats: self.repeats + 1,
                ..Self::default()
            };
        }
    }

    /// What the device does otherwise than it was asked.
    pub fn complain(&mut self, complaint: String) {
        self.complaint = complaint;
    }

    /// What the device refused, or an empty text.
    pub fn complaint(&self) -> &str {
        &self.complaint
    }
}

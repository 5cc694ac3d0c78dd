//! The talk with a device after its port was opened: one command at a time, each answered or given up.
//!
//! Responsible for when a command is sent and sent again. Not responsible for its bytes, which are the protocol's.
//! A device that answers nothing is not silent yet: it may stream what somebody else configured.

/// Sent again after this time: a device at 115200 baud has hundreds of bytes of measurements to send before its answer.
const PATIENCE_NS: i64 = 300_000_000;
/// Given up after so many.
const TRIES: u8 = 3;

/// Where the talk is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversation<Step> {
    step: Step,
    tries: u8,
    again_ns: i64,
}

impl<Step: Copy + PartialEq> Conversation<Step> {
    /// Begins with a step.
    pub fn at(step: Step) -> Self {
        Self {
            step,
            tries: 0,
            again_ns: i64::MIN,
        }
    }

    /// The step whose answer is waited for.
    pub fn step(&self) -> Step {
        self.step
    }

    /// When it wants to be asked again; none while it has not yet sent anything.
    pub fn due_ns(&self) -> i64 {
        self.again_ns
    }

    /// What to do now.
    pub fn turn(&mut self, now_ns: i64) -> Turn {
        if now_ns < self.again_ns {
            return Turn::Wait;
        }
        if self.tries == TRIES {
            return Turn::GiveUp;
        }
        self.tries += 1;
        self.again_ns = now_ns.saturating_add(PATIENCE_NS);
        Turn::Send
    }
}

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Send this step's command.
    Send,
    /// Nothing.
    Wait,
    /// No answer came: go on without.
    GiveUp,
}

//! How a stage is, and when it publishes that.

use crate::domain::Entry;
use randt_messages::{HEALTH_PORTS, PortHealth, StageHealth, StageState, health::fixed_text};

/// Health is published twice a second.
const PERIOD_NS: i64 = 500_000_000;

/// How a stage is.
#[derive(Debug, Default)]
pub(crate) struct StageStatus {
    pub state: StageState,
    /// What is wrong, or a remark while all is well.
    pub message: String,
    /// Data lost in the stage itself.
    lost: u64,
    /// When health is published next, ns.
    pub next_publish_ns: i64,
}

impl StageStatus {
    /// Before the loop begins; nothing is published until then.
    pub(crate) fn starting() -> Self {
        Self {
            next_publish_ns: i64::MAX,
            ..Self::default()
        }
    }

    /// Sets what is wrong; an empty text says that nothing is. Returns whether that is to be
    /// logged.
    pub(crate) fn set(&mut self, message: &str, lost: u64) -> bool {
        let is_new = self.message != message;
        self.lost = lost;
        self.state = match message {
            "" => StageState::Running,
            _ => StageState::Degraded,
        };
        if is_new {
            message.clone_into(&mut self.message);
        }
        is_new && !message.is_empty()
    }

    /// Sets a remark, unless something is wrong.
    pub(crate) fn set_remark(&mut self, message: &str) {
        if self.state == StageState::Running && self.message != message {
            message.clone_into(&mut self.message);
        }
    }

    /// Whether health is to be published.
    pub(crate) fn is_due(&self, now_ns: i64) -> bool {
        now_ns >= self.next_publish_ns
    }

    /// Health is due now.
    pub(crate) fn publish_at_once(&mut self) {
        self.next_publish_ns = i64::MIN;
    }

    /// The message that is published now. `entry`: what the register says of the stage.
    pub(crate) fn health(
        &mut self,
        now_ns: i64,
        entry: &Entry,
        ports: &[PortHealth],
    ) -> StageHealth {
        self.next_publish_ns = now_ns + PERIOD_NS;
        let mut health = StageHealth {
            name: fixed_text(&entry.name),
            message: fixed_text(&self.message),
            pid: u64::from(std::process::id()),
            started_ns: entry.started_ns,
            restarts: entry.starts.saturating_sub(1),
            lost: self.lost,
            state: self.state as u32,
            port_count: ports.len().min(HEALTH_PORTS) as u32,
            ports: [PortHealth::default(); HEALTH_PORTS],
            ..StageHealth::default()
        };
        health.header.stamp_ns = now_ns;
        for (to, from) in health.ports.iter_mut().zip(ports) {
            *to = *from;
        }
        health
    }
}

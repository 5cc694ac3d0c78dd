//! When and how a stage tells the others how it is.

use randt_messages::{HEALTH_PORTS, PortHealth, StageHealth, StageState, health::fixed_text};

use crate::ports::PortCounters;
use std::rc::Rc;

/// Twice a second.
pub(crate) const PERIOD_NS: i64 = 500_000_000;

/// What a stage knows of itself.
#[derive(Debug)]
pub(crate) struct Condition {
    pub name: String,
    pub started_ns: i64,
    pub restarts: u64,
    pub state: StageState,
    pub message: String,
    pub lost: u64,
}

impl Condition {
    /// As its message.
    pub(crate) fn health(&self, now_ns: i64, ports: &[Rc<PortCounters>]) -> StageHealth {
        let mut health = StageHealth {
            name: fixed_text(&self.name),
            message: fixed_text(&self.message),
            pid: u64::from(std::process::id()),
            started_ns: self.started_ns,
            restarts: self.restarts,
            lost: self.lost,
            state: self.state as u32,
            port_count: ports.len().min(HEALTH_PORTS) as u32,
            ports: [PortHealth::default(); HEALTH_PORTS],
            ..StageHealth::default()
        };
        health.header.stamp_ns = now_ns;
        for (to, from) in health.ports.iter_mut().zip(ports) {
            *to = from.health();
        }
        health
    }
}

//! What goes through a port, as `stage/health` has it.

use randt_messages::{
    PortHealth,
    health::{fixed_text, text_of},
};
use std::cell::Cell;
use std::rc::Rc;

/// Counters of one port, shared by the port and its stage.
#[derive(Debug)]
pub(crate) struct PortCounters {
    health: Cell<PortHealth>,
}

impl PortCounters {
    pub(crate) fn new(topic: &str, publishes: bool) -> Rc<Self> {
        let health = PortHealth {
            topic: fixed_text(topic),
            publishes: u64::from(publishes),
            ..PortHealth::default()
        };
        Rc::new(Self {
            health: Cell::new(health),
        })
    }

    /// One message went through.
    pub(crate) fn count(&self, published_ns: i64) {
        let mut health = self.health.get();
        health.messages += 1;
        health.last_published_ns = published_ns;
        self.health.set(health);
    }

    /// Messages were missed.
    pub(crate) fn lose(&self, messages: u64) {
        let mut health = self.health.get();
        health.lost += messages;
        self.health.set(health);
    }

    pub(crate) fn health(&self) -> PortHealth {
        self.health.get()
    }

    pub(crate) fn is(&self, topic: &str, publishes: bool) -> bool {
        let health = self.health.get();
        text_of(&health.topic) == topic && health.publishes == u64::from(publishes)
    }
}

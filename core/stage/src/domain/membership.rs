//! This process as a member of its domain: the name that it runs under, and what the others see of
//! it.

use super::{Clock, Domain, Presence, Registry};
use crate::{Error, dead_node_cleanup::clean_up_before_start};
use randt_messages::Topic;
use std::fs::File;

/// What a stage holds in its domain until it ends.
#[derive(Debug)]
pub(crate) struct Membership {
    /// What the register says of the stage.
    pub registry: Registry,
    pub presence: Presence,
    /// The lock of those who start; held until the loop begins.
    start: Option<File>,
    pub domain: Domain,
    pub clock: Clock,
}

impl Membership {
    /// Enters a domain under a name; clears away what dead stages have left, so that their memory
    /// is free when memory is counted. Refuses where that name is taken.
    pub(crate) fn enter(domain: &Domain, name: &str) -> Result<Self, Error> {
        let presence = domain.enter()?;
        let clock = Clock::in_domain(domain)?;
        let registry = Registry::enter(domain, name, clock.now_ns())?;
        let start = domain.start()?;
        clean_up_before_start(domain)?;
        Ok(Self {
            registry,
            presence,
            start: Some(start),
            domain: domain.clone(),
            clock,
        })
    }

    /// The stage's name.
    pub(crate) fn name(&self) -> &str {
        &self.registry.entry().name
    }

    /// The epoch of the messages of this process: when it started, ns.
    pub(crate) fn epoch(&self) -> u64 {
        self.registry.entry().started_ns.unsigned_abs()
    }

    /// Registers that the stage has opened a topic.
    pub(crate) fn add_topic<T: Topic>(&mut self) -> Result<(), Error> {
        self.registry.add_topic(T::NAME, T::TYPE_NAME)
    }

    /// The start is over: the next process may start.
    pub(crate) fn end_start(&mut self) {
        self.start = None;
    }
}

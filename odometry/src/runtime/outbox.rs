//! Results that are to be published, kept until they surely were.

use crate::Sink;
use randt_messages::{Keyframe, MessageRef, OdometryState};
use randt_stage::KeyframeRing;
use std::collections::VecDeque;

/// States that are sent again after a restart: those that a reader may have missed because their
/// publisher died. As many as a reader has room for: all those of a stage that was catching up
/// when it was killed.
const STATES: usize = 32;
const STATE: usize = size_of::<OdometryState>();
/// Bytes of the outbox in a record.
pub(super) const BYTES: usize = 8 + STATES * STATE;

/// The last states, and which keyframes are new. Keyframes go to the ring at once.
#[derive(Debug, Default)]
pub struct Outbox {
    states: VecDeque<OdometryState>,
    /// How many of the states, from the newest on, have not been sent.
    unsent: usize,
    /// Keyframes that have not been sent.
    pub(super) keyframes: VecDeque<u64>,
}

/// Takes the results of odometry.
pub(super) struct ResultSink<'a> {
    pub outbox: &'a mut Outbox,
    pub ring: &'a mut KeyframeRing,
}

impl Sink for ResultSink<'_> {
    fn state(&mut self, state: &OdometryState) {
        let outbox = &mut *self.outbox;
        if outbox.states.len() == STATES.max(outbox.unsent + 1) {
            outbox.states.pop_front();
        }
        outbox.states.push_back(*state);
        outbox.unsent += 1;
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.ring.push(keyframe);
        self.outbox.keyframes.push_back(keyframe.head.id);
    }
}

impl Outbox {
    /// Whether there is nothing to be sent.
    pub fn is_empty(&self) -> bool {
        self.unsent == 0 && self.keyframes.is_empty()
    }

    /// Takes the states that have not been sent, oldest first.
    pub fn take_states(&mut self) -> impl Iterator<Item = &OdometryState> {
        let unsent = std::mem::take(&mut self.unsent);
        self.states
            .iter()
            .skip(self.states.len().saturating_sub(unsent))
    }

    /// Writes the last states in front of a record.
    pub(super) fn save(&self, out: &mut [u8]) {
        let skip = self.states.len().saturating_sub(STATES);
        let states = self.states.iter().skip(skip);
        let (count, entries) = out.split_at_mut(8.min(out.len()));
        count.copy_from_slice(&(states.len() as u64).to_le_bytes()[..count.len()]);
        for (entry, state) in entries.chunks_exact_mut(STATE).zip(states) {
            entry.copy_from_slice(bytemuck::bytes_of(state));
        }
    }

    /// The states of a record, all to be sent again.
    pub(super) fn restore(bytes: &[u8]) -> Self {
        let count = bytes.first_chunk().map_or(0, |c| u64::from_le_bytes(*c));
        let entries = bytes.get(8..BYTES).unwrap_or_default();
        let states: VecDeque<OdometryState> = entries
            .chunks_exact(STATE)
            .take(count.min(STATES as u64) as usize)
            .map(bytemuck::pod_read_unaligned)
            .collect();
        Self {
            unsent: states.len(),
            states,
            keyframes: VecDeque::new(),
        }
    }
}

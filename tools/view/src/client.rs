//! What one viewer has, and what it gets next: the newest of the most important.

use crate::protocol::Request;
use crate::sent_entities::SentEntities;
use crate::status_text::status_text;
use crate::{Board, Flow, protocol};
use randt_foxglove_schemas::{ViewerTopic, bytes, pose_of_state, status, transforms};
use randt_log::write_cdr;
use randt_messages::{MessageRef, OdometryState, OdometryStateTopic};
use std::collections::{BTreeMap, VecDeque};

/// A cloud takes this much of the link's time, s.
const CLOUD_TAKES_S: f64 = 0.2;
/// Where a whole cloud is a matter of moments, from this rate on in bytes a second, ...
const FAST: f64 = 250_000.0;
/// ... it comes with this period instead of its usual one.
const CLOUD_FAST_NS: i64 = 450_000_000;
/// The state with all its numbers goes with every pose from this rate on in bytes a second, ...
const STATES_FAST: f64 = 100_000.0;
/// ... else with this period.
const STATES_SLOW_NS: i64 = 1_000_000_000;
/// A cloud of fewer bytes than this shows nothing.
const CLOUD_LEAST: f64 = 1_200.0;
/// Allowed beyond the window: pose and status do not wait for what fills the link.
const BEYOND: f64 = 2_000.0;
/// Time never goes back for viewers by less than this, ns: they would forget everything.
const JITTER_NS: i64 = 10_000_000_000;

/// A message on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Frame {
    /// A text message.
    Text(String),
    /// A binary message.
    Binary(Vec<u8>),
}

impl Frame {
    /// Bytes on the link.
    pub fn size(&self) -> usize {
        let head = 4;
        head + match self {
            Self::Text(text) => text.len(),
            Self::Binary(bytes) => bytes.len(),
        }
    }
}

/// One viewer.
#[derive(Debug, Default)]
pub struct Client {
    /// What is sent first, in order.
    greeting: VecDeque<String>,
    /// By channel: the subscription's number.
    subscriptions: BTreeMap<ViewerTopic, u32>,
    /// By channel: the number of the last state or cloud that went out.
    had: BTreeMap<ViewerTopic, u64>,
    entities: SentEntities,
    status_ns: i64,
    log_ns: i64,
    cloud_ns: i64,
    state_ns: i64,
    time_ns: i64,
    time_of: u64,
    /// Frames that were overtaken by newer ones before they could go.
    pub dropped: u64,
}

impl Client {
    /// One that has just connected.
    pub fn new(session: &str) -> Self {
        let mut greeting = VecDeque::from([protocol::server_info(session)]);
        let adverts = ViewerTopic::ALL
            .map(|topic| protocol::advertise(topic.channel_id(), &topic.live_channel()));
        greeting.extend(adverts);
        Self {
            greeting,
            ..Self::default()
        }
    }

    /// Takes a text message of the viewer.
    pub fn receive(&mut self, text: &str) {
        match protocol::request(text) {
            Request::Subscribe(wanted) => {
                for (subscription, channel) in wanted {
                    self.subscribe(subscription, channel);
                }
            }
            Request::Unsubscribe(gone) => {
                self.subscriptions
                    .retain(|_, number| !gone.contains(number));
            }
            Request::Other => {}
        }
    }

    fn subscribe(&mut self, subscription: u32, channel: u32) {
        let Some(topic) = ViewerTopic::from_channel_id(channel) else {
            let warning = format!("there is no channel {channel}");
            // One is enough for a viewer that asks for many.
            if self.greeting.is_empty() {
                self.greeting.push_back(protocol::warning(&warning));
            }
            return;
        };
        // Everything is sent again: a panel that was opened just now has nothing.
        self.entities.forget(topic);
        match topic {
            ViewerTopic::Status => self.status_ns = 0,
            ViewerTopic::Log => self.log_ns = 0,
            ViewerTopic::Points => self.cloud_ns = 0,
            ViewerTopic::State => self.state_ns = 0,
            _ => {}
        }
        self.had.remove(&topic);
        self.subscriptions.insert(topic, subscription);
    }

    fn subscription(&self, topic: ViewerTopic) -> Option<u32> {
        self.subscriptions.get(&topic).copied()
    }

    /// The next message, where there is one and it may go now.
    pub fn next(&mut self, board: &Board, flow: &Flow, now_ns: i64) -> Option<Frame> {
        if flow.has_room(0, BEYOND) {
            let urgent = self.status(board, flow, now_ns);
            let urgent = urgent.or_else(|| self.state(board, flow, now_ns));
            if urgent.is_some() {
                return urgent;
            }
        }
        if !flow.has_room(0, 0.0) {
            return None;
        }
        if let Some(text) = self.greeting.pop_front() {
            return Some(Frame::Text(text));
        }
        match self.cloud(board, now_ns) {
            Some(subscription) => self.points(subscription, board, flow, now_ns),
            None => self.entity(board, flow, now_ns),
        }
    }

    fn status(&mut self, board: &Board, flow: &Flow, now_ns: i64) -> Option<Frame> {
        // Also when nothing comes.
        let due = |topic: ViewerTopic, then_ns: i64| {
            let is_due = now_ns.saturating_sub(then_ns) >= topic.live_period_ns();
            self.subscription(topic).filter(|_| is_due)
        };
        let text = due(ViewerTopic::Status, self.status_ns);
        let line = due(ViewerTopic::Log, self.log_ns);
        if text.is_none() && line.is_none() {
            return None;
        }
        if let Some(time) = self.time(board, now_ns, u64::MAX) {
            return Some(time);
        }
        let (text_shown, level) = status_text(board, now_ns, flow.round_trip_s(now_ns));
        let stamp_ns = self.time_ns;
        self.time_of = 0;
        let (subscription, payload) = match (text, line) {
            (Some(text), _) => {
                self.status_ns = now_ns;
                let update = status::text(stamp_ns, &text_shown, level, board.state.as_ref());
                (text, bytes(&update)?)
            }
            (None, line) => {
                self.log_ns = now_ns;
                (line?, bytes(&status::line(stamp_ns, &text_shown, level))?)
            }
        };
        Some(data(subscription, stamp_ns, &payload))
    }

    /// The time, sent once before the messages of that time.
    fn time(&mut self, board: &Board, now_ns: i64, state: u64) -> Option<Frame> {
        if self.time_of == state {
            return None;
        }
        self.time_of = state;
        let time_ns = board.time_ns(now_ns);
        let is_back = (self.time_ns - JITTER_NS..self.time_ns).contains(&time_ns);
        self.time_ns = if is_back { self.time_ns } else { time_ns };
        Some(Frame::Binary(protocol::time(self.time_ns)))
    }

    fn state(&mut self, board: &Board, flow: &Flow, now_ns: i64) -> Option<Frame> {
        let state = board.state?;
        for topic in [
            ViewerTopic::Transforms,
            ViewerTopic::Pose,
            ViewerTopic::State,
        ] {
            let had = self.had.get(&topic).copied();
            let is_thinned = topic == ViewerTopic::State && flow.rate() < STATES_FAST;
            let is_early = is_thinned && now_ns - self.state_ns < STATES_SLOW_NS;
            let is_due = had != Some(board.states) && !is_early;
            let Some(subscription) = self.subscription(topic).filter(|_| is_due) else {
                continue;
            };
            if let Some(time) = self.time(board, now_ns, board.states) {
                return Some(time);
            }
            let payload = match topic {
                ViewerTopic::Pose => bytes(&pose_of_state(&state))?,
                ViewerTopic::State => state_bytes(&state),
                _ => bytes(&transforms(&board.robot, &state, board.correction.as_ref()))?,
            };
            if topic == ViewerTopic::State {
                self.state_ns = now_ns;
            } else {
                self.dropped += had.map_or(0, |had| board.states - had - 1);
            }
            self.had.insert(topic, board.states);
            return Some(data(subscription, state.header.stamp_ns, &payload));
        }
        None
    }

    /// The subscription of the cloud where one is due.
    fn cloud(&self, board: &Board, now_ns: i64) -> Option<u32> {
        let had = self.had.get(&ViewerTopic::Points);
        let is_new = board.points.is_some() && had != Some(&board.clouds);
        let subscription = self.subscription(ViewerTopic::Points);
        subscription.filter(|_| is_new && now_ns >= self.cloud_ns)
    }

    /// The cloud, thinned to what the link takes. Where there is no room for it now, tiles wait as
    /// well: they would always be smaller.
    fn points(
        &mut self,
        subscription: u32,
        board: &Board,
        flow: &Flow,
        now_ns: i64,
    ) -> Option<Frame> {
        let points = board.points.as_ref()?;
        let bytes_max = (flow.rate() * CLOUD_TAKES_S).max(CLOUD_LEAST);
        let cloud = randt_foxglove_schemas::of_some_points(points.as_ref(), bytes_max as usize);
        let payload = bytes(&cloud)?;
        if !flow.has_room(payload.len(), 0.0) {
            return None;
        }
        let period_ns = match flow.rate() > FAST {
            true => CLOUD_FAST_NS,
            false => ViewerTopic::Points.live_period_ns(),
        };
        self.cloud_ns = now_ns + period_ns;
        self.had.insert(ViewerTopic::Points, board.clouds);
        Some(data(subscription, points.head.header.stamp_ns, &payload))
    }

    /// An entity of path or grid that it does not have.
    fn entity(&mut self, board: &Board, flow: &Flow, now_ns: i64) -> Option<Frame> {
        let wanted = |topic| self.subscriptions.get(&topic).copied();
        let (subscription, payload) = self.entities.next(board, flow, now_ns, wanted)?;
        Some(data(subscription, board.time_ns(now_ns), &payload))
    }
}

/// A state as a log has it.
fn state_bytes(head: &OdometryState) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_cdr(
        MessageRef::<OdometryStateTopic> { head, items: &[] },
        &mut bytes,
    );
    bytes
}

fn data(subscription: u32, log_time_ns: i64, payload: &[u8]) -> Frame {
    Frame::Binary(protocol::message_data(subscription, log_time_ns, payload))
}

#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod tests;

//! One end of the link: what goes next, what came, what has to go again. Pure: time and bytes come
//! in, bytes go out.

use crate::bucket::Bucket;
use crate::cargo::{Cargo, Unknown, bytes_of, load_newest};
use crate::clock_offset::ClockOffset;
use crate::flow::Flow;
use crate::frame::{self, Entry, Frame, Position};
use crate::newest::NewestTopic;
use crate::session::{Admission, Session, has_arrived};
use crate::stream::OutStream;
use std::collections::VecDeque;
use std::time::Duration;

/// What IP, TCP, TLS and Zenoh add to a frame, with the acknowledgements of what comes, and what
/// each further packet of a longer frame adds, bytes: by the bytes on a wire of 6 and 12 kB/s.
const OVERHEAD: usize = 170;
const PACKET_HEAD: usize = 52;
/// Bytes of a frame that fit into a packet of a radio's 1400.
const PACKET: usize = 1200;
/// A frame with what cannot wait goes this often at most, and less often where the link takes less
/// than [`SLOW`]: each costs its overhead.
const PACE_NS: i64 = 100_000_000;
const SLOW_PACE_NS: i64 = 180_000_000;
/// Bytes a second.
const SLOW: f64 = 20_000.0;
/// Frames whose arrival is unknown, at most: answers tell 64 apart.
const UNKNOWN_MAX: usize = 60;
/// A frame has at least this much room: a tenth of a second of the slowest link.
const FRAME_MIN: usize = 700;
/// ... and at most.
const FRAME_MAX: usize = 16_000;
/// A frame takes this long on the link: what cannot wait, waits behind one.
const FRAME_S: f64 = 0.1;
/// Bytes of the window that are kept for what cannot wait, and that it may take beyond it: an
/// eighth of a second of the slowest link.
const URGENT: f64 = 1_000.0;
/// An answer waits this long for something that takes it along.
const ANSWER_NS: i64 = 50_000_000;
/// Without anything else a frame goes this often: each end sees that the other one is there.
const BEAT_NS: i64 = 1_000_000_000;
/// Frames of a process that was replaced may still be under way for this time.
const REPLACED_NS: i64 = 5_000_000_000;
/// Silence of the other end after which what is under way counts no more as filling the link.
const SILENT_S: f64 = 3.0;

/// Bytes of a frame on the wire.
pub fn on_wire(bytes: usize) -> usize {
    bytes + OVERHEAD + bytes / PACKET * PACKET_HEAD
}

/// What came, for this machine's bus.
#[derive(Debug, PartialEq, Eq)]
pub struct Received {
    /// Index among the bus's topics.
    pub topic: u8,
    /// Under which it is the newest.
    pub key: Option<u64>,
    /// Of a stream: where it goes on.
    pub next: Option<Position>,
    /// As it was pushed.
    pub message: Vec<u8>,
}

/// Why a frame was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It is none of this build's.
    #[error(transparent)]
    Frame(#[from] frame::Error),
    /// It came before, or was meant for another process.
    #[error("a frame that was sent before, or for another process: a replayed stream")]
    Replayed,
    /// It is of a process that another one has replaced.
    #[error("another one has this name too, or a stream is replayed: the last one to come stays")]
    Former,
}

/// One end: who is there, what is carried, how much may go, and what is known of its arrival. Its
/// fields all change with each frame.
pub struct Peer {
    session: Session,
    pub cargo: Cargo,
    bucket: Bucket,
    flow: Flow,
    pub clock_offset: ClockOffset,
    number: u64,
    unknown: VecDeque<Unknown>,
    /// `sent_ns` of the other end's last frame, when it came, and the newest mark.
    echo: Option<(i64, i64)>,
    mark_back: Option<(u64, i64)>,
    /// When an answer has to go, when something urgent may, when the last frame went.
    answer_ns: Option<i64>,
    pace_ns: i64,
    sent_ns: i64,
    heard_ns: Option<i64>,
    /// When the process at the other end was heard first, ns.
    since_ns: i64,
    /// Bytes with their overhead, both ways.
    pub bytes_sent: u64,
    pub bytes_received: u64,
    /// Frames that were refused, and entries that did not arrive and went again.
    pub refused: u64,
    pub sent_again: u64,
}

impl Peer {
    /// Of a process that begins. `rate_max`: bytes a second, 0 for no limit.
    pub fn new(cargo: Cargo, rate_max: f64) -> Self {
        Self {
            session: Session::new(),
            cargo,
            bucket: Bucket::new(rate_max),
            flow: Flow::default(),
            clock_offset: ClockOffset::default(),
            number: 0,
            unknown: VecDeque::new(),
            echo: None,
            mark_back: None,
            answer_ns: None,
            pace_ns: i64::MIN,
            sent_ns: i64::MIN,
            heard_ns: None,
            since_ns: i64::MIN,
            bytes_sent: 0,
            bytes_received: 0,
            refused: 0,
            sent_again: 0,
        }
    }

    /// When the other end was heard last, ns.
    pub fn heard_ns(&self) -> Option<i64> {
        self.heard_ns
    }

    /// Takes a frame.
    pub fn receive(&mut self, bytes: &[u8], now_ns: i64) -> Result<Vec<Received>, Refusal> {
        self.bytes_received += on_wire(bytes.len()) as u64;
        let frame = Frame::from_bytes(bytes).inspect_err(|_| self.refused += 1)?;
        let admission = self.session.admit(&frame);
        match admission {
            Admission::Refused => {
                self.refused += 1;
                return Err(Refusal::Replayed);
            }
            Admission::Former => {
                if now_ns.saturating_sub(self.since_ns) < REPLACED_NS {
                    return Ok(Vec::new());
                }
                self.refused += 1;
                return Err(Refusal::Former);
            }
            Admission::Asked => {
                self.answer_ns = Some(now_ns);
                return Ok(Vec::new());
            }
            Admission::TakenAnew => self.begin_anew(now_ns),
            Admission::Taken => {}
        }
        self.heard_ns = Some(now_ns);
        self.echo = Some((frame.sent_ns, now_ns));
        if frame.echo_ns != 0 {
            let came_ns = frame.sent_ns.saturating_sub(frame.held_ns);
            self.clock_offset
                .push(frame.echo_ns, came_ns, frame.sent_ns, now_ns);
        }
        if frame.mark_back != 0 {
            self.flow
                .answered(frame.mark_back, frame.mark_held_ns, now_ns);
        }
        if frame.mark != 0 {
            self.mark_back = Some((frame.mark, now_ns));
        }
        // What arrived first: what is lost goes back to what is wanted.
        for (topic, wanted) in &frame.wanted {
            let streams = self.cargo.streams.iter_mut();
            for stream in streams.filter(|stream| stream.topic == *topic) {
                stream.set_wanted(*wanted, self.number);
            }
        }
        self.judge_unknown(frame.highest, frame.arrived);
        if !frame.entries.is_empty() || frame.mark != 0 {
            self.answer_ns = self.answer_ns.or(Some(now_ns + ANSWER_NS));
        }
        let entries = frame.entries.into_iter();
        Ok(entries.filter_map(|entry| self.take(entry)).collect())
    }

    fn take(&mut self, entry: Entry) -> Option<Received> {
        match entry {
            Entry::Newest(newest) => Some(Received {
                topic: newest.topic,
                key: Some(newest.key),
                next: None,
                message: newest.message,
            }),
            Entry::Piece(piece) => {
                let mut streams = self.cargo.incoming.iter_mut();
                let stream = streams.find(|stream| stream.topic == piece.topic)?;
                let message = stream.take(&piece)?;
                Some(Received {
                    topic: piece.topic,
                    key: None,
                    next: Some(stream.wanted()),
                    message,
                })
            }
        }
    }

    /// Another process is at the other end: it has nothing of what is kept here.
    fn begin_anew(&mut self, now_ns: i64) {
        self.unknown.clear();
        self.flow = Flow::default();
        self.clock_offset.clear();
        self.echo = None;
        self.mark_back = None;
        self.since_ns = now_ns;
        self.answer_ns = Some(now_ns);
        self.cargo
            .newest
            .iter_mut()
            .for_each(NewestTopic::queue_all);
        for stream in &mut self.cargo.streams {
            stream.begin_anew(self.number);
        }
    }

    fn judge_unknown(&mut self, highest: u64, arrived: u64) {
        while let Some(first) = self.unknown.front() {
            let Some(has_arrived) = has_arrived(first.number, highest, arrived) else {
                break;
            };
            if let Some(first) = self.unknown.pop_front()
                && !has_arrived
            {
                self.lost(&first);
            }
        }
    }

    fn lost(&mut self, frame: &Unknown) {
        self.sent_again += (frame.newest.len() + frame.streams.len()) as u64;
        for sent in frame.newest.iter().rev() {
            let topics = self.cargo.newest.iter_mut();
            for topic in topics.filter(|topic| topic.topic == sent.topic) {
                topic.lost(sent);
            }
        }
        for stream in &mut self.cargo.streams {
            if frame.streams.contains(&stream.topic) {
                stream.lost(frame.number, self.number);
            }
        }
    }

    /// The next frame, where one goes now.
    pub fn next_frame(&mut self, now_ns: i64) -> Option<Vec<u8>> {
        let mut frame = Frame::default();
        let mut record = Unknown {
            number: self.number + 1,
            newest: Vec::new(),
            streams: Vec::new(),
        };
        let is_beat = now_ns.saturating_sub(self.sent_ns) >= BEAT_NS;
        let has_budget = self.bucket.has_some(now_ns);
        if self.session.is_open() && self.session.is_known() && has_budget {
            self.load(&mut frame, &mut record, is_beat, now_ns);
        }
        let is_answer = self.answer_ns.is_some_and(|due_ns| now_ns >= due_ns);
        if frame.entries.is_empty() && !is_answer && !is_beat {
            return None;
        }
        self.number += 1;
        self.session.sign(&mut frame);
        frame.number = self.number;
        frame.sent_ns = now_ns;
        if let Some((sent_ns, came_ns)) = self.echo {
            frame.echo_ns = sent_ns;
            frame.held_ns = now_ns.saturating_sub(came_ns);
        }
        if let Some((mark, came_ns)) = self.mark_back.take() {
            frame.mark_back = mark;
            frame.mark_held_ns = now_ns.saturating_sub(came_ns);
        }
        let incoming = self.cargo.incoming.iter();
        frame.wanted = incoming.map(|it| (it.topic, it.wanted())).collect();
        let mut bytes = frame.to_bytes();
        self.flow.wrote(on_wire(bytes.len()), now_ns);
        if let Some(mark) = self.flow.mark(now_ns, is_beat) {
            frame.mark = mark;
            bytes = frame.to_bytes();
        }
        self.bucket.spend(on_wire(bytes.len()));
        self.bytes_sent += on_wire(bytes.len()) as u64;
        (self.answer_ns, self.sent_ns) = (None, now_ns);
        if !frame.entries.is_empty() {
            self.unknown.push_back(record);
            if self.unknown.len() > UNKNOWN_MAX
                && let Some(oldest) = self.unknown.pop_front()
            {
                self.lost(&oldest);
            }
        }
        Some(bytes)
    }

    /// Puts into a frame what goes now.
    fn load(&mut self, frame: &mut Frame, record: &mut Unknown, is_beat: bool, now_ns: i64) {
        let is_silent = self.flow.silent_s(now_ns) > SILENT_S.max(4.0 * self.trip_s());
        let mut room = self.frame_bytes();
        let pace_ns = if self.flow.rate() < SLOW {
            SLOW_PACE_NS
        } else {
            PACE_NS
        };
        // In silence one with what cannot wait now and then: its answer shows what was lost.
        let urgent_goes = match is_silent {
            true => is_beat,
            false => now_ns >= self.pace_ns && self.flow.has_urgent_room(URGENT),
        };
        if urgent_goes {
            for topic in self.cargo.newest.iter_mut().filter(|it| it.is_urgent) {
                load_newest(topic, frame, record, &mut room, now_ns);
            }
            if !frame.entries.is_empty() {
                self.pace_ns = now_ns + pace_ns;
            }
        }
        let has_room = room >= FRAME_MIN / 2 && self.flow.has_room(room, URGENT, now_ns);
        if is_silent || !has_room {
            return;
        }
        for stream in &mut self.cargo.streams {
            while room > 0 && stream.bucket.has_some(now_ns) {
                let Some(entry) = stream.take(room) else {
                    break;
                };
                let bytes = bytes_of(&entry);
                room = room.saturating_sub(bytes);
                stream.bucket.spend(bytes);
                frame.entries.push(entry);
                record.streams.push(stream.topic);
            }
        }
        for topic in self.cargo.newest.iter_mut().filter(|it| !it.is_urgent) {
            load_newest(topic, frame, record, &mut room, now_ns);
        }
    }

    /// Room in a frame by what the link takes.
    fn frame_bytes(&self) -> usize {
        ((self.flow.rate() * FRAME_S) as usize).clamp(FRAME_MIN, FRAME_MAX)
    }

    fn trip_s(&self) -> f64 {
        self.clock_offset.trip_ns().unwrap_or(0) as f64 * 1e-9
    }

    /// How long nothing has to be sent, unless something comes.
    pub fn pause(&self, now_ns: i64) -> Duration {
        let is_open = self.session.is_open() && self.session.is_known();
        let beat_ns = self.sent_ns.saturating_add(BEAT_NS);
        let newest = &self.cargo.newest;
        let is_urgent = is_open && newest.iter().any(|it| it.is_urgent && it.is_waiting());
        let is_waiting = is_open
            && (newest.iter().any(NewestTopic::is_waiting)
                || self.cargo.streams.iter().any(OutStream::is_waiting));
        let mut next_ns = beat_ns;
        if let Some(answer_ns) = self.answer_ns {
            next_ns = next_ns.min(answer_ns);
        }
        if is_urgent {
            next_ns = next_ns.min(self.pace_ns.max(now_ns + 5_000_000));
        }
        if is_waiting {
            // Answers wake it too; this is for rates.
            next_ns = next_ns.min(now_ns + 20_000_000);
        }
        Duration::from_nanos(next_ns.saturating_sub(now_ns).max(0).unsigned_abs())
    }
}

#[cfg(test)]
mod tests;

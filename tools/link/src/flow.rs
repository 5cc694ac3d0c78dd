//! How much may be under way: as much as the link takes without a queue. The idea is that of the
//! viewers' (`tools/view/src/flow.rs`), for a link on which packets are lost and whose delay
//! changes: an answer that comes late alone is no queue, and the shortest time is measured anew.
//! Pure: time comes in.

use std::collections::VecDeque;

/// How long data may wait on their way behind others, s.
const QUEUE_S: f64 = 0.15;
/// Under way at first and at least: what keeps the slowest link in use, bytes.
const LEAST: f64 = 3_000.0;
/// ... and at most.
const MOST: f64 = 1_000_000.0;
/// A mark goes with this many bytes, or after this time without one, s.
const MARK_EVERY: u64 = 1_000;
const MARK_PAUSE_S: f64 = 1.0;
/// A message that was lost holds up those behind it for some round trips: the fastest answer of
/// this time shows the queue, s.
const RECENT_S: f64 = 1.0;
/// A step down leaves at least this share.
const SHRINK: f64 = 0.6;
/// Share of what arrived by which the window grows once the link's end was found.
const CAREFUL: f64 = 0.1;
/// ... and where next to nothing waits: the link takes more than before.
const BOLD: f64 = 0.4;
const EMPTY: f64 = 0.8;
/// What goes is this much faster than the link is known to be.
const AHEAD: f64 = 1.25;
/// The queue is let run empty this often, s, to see the shortest time from mark to answer.
const DRAIN_EVERY_S: f64 = 20.0;
/// ... for this many round trips at most: what cannot wait goes on.
const DRAIN_TRIPS: f64 = 2.0;

/// What is known of the way to the other end: what is under way, how long it takes, and how much
/// may go, fields that all
/// change with each answer.
#[derive(Debug)]
pub struct Flow {
    /// Bytes handed over, and of those the ones known to have arrived.
    sent: u64,
    arrived: u64,
    /// Marks without an answer: bytes sent before, and when.
    marks: VecDeque<(u64, i64)>,
    marked: u64,
    marked_ns: Option<i64>,
    /// Shortest time from mark to answer since the last time that the queue was empty, and in the
    /// time before that one, s.
    least_s: [Option<f64>; 2],
    /// Answers of late: when, and how long they took, s.
    recent: VecDeque<(i64, f64)>,
    window: f64,
    shrunk_ns: i64,
    /// Whether something had to wait since the last answer.
    is_used: bool,
    /// When the next one may go, ns.
    paced_ns: i64,
    /// When the queue is let run empty next, and until when.
    drain_ns: i64,
    drained_ns: i64,
}

impl Default for Flow {
    fn default() -> Self {
        Self {
            sent: 0,
            arrived: 0,
            marks: VecDeque::new(),
            marked: 0,
            marked_ns: None,
            least_s: [None; 2],
            recent: VecDeque::new(),
            window: LEAST,
            shrunk_ns: 0,
            is_used: false,
            paced_ns: 0,
            drain_ns: 0,
            drained_ns: 0,
        }
    }
}

impl Flow {
    /// This many bytes were handed over.
    pub fn wrote(&mut self, bytes: usize, now_ns: i64) {
        self.sent += bytes as u64;
        // A window that goes at once is a queue.
        let ahead = if self.shrunk_ns == 0 { 2.0 } else { AHEAD };
        let takes_s = bytes as f64 / (ahead * self.rate());
        self.paced_ns = self.paced_ns.max(now_ns) + (takes_s * 1e9) as i64;
    }

    fn under_way(&self) -> f64 {
        (self.sent - self.arrived) as f64
    }

    /// Whether what cannot wait may go. `beyond`: bytes beside the window that are kept for it.
    pub fn has_urgent_room(&self, beyond: f64) -> bool {
        self.under_way() <= self.window + beyond
    }

    /// Whether something that can wait may go now. `kept`: bytes that are left for what cannot.
    pub fn has_room(&mut self, bytes: usize, kept: f64, now_ns: i64) -> bool {
        if now_ns >= self.drain_ns {
            let trip_s = self.least().unwrap_or(0.0) + QUEUE_S;
            self.drained_ns = now_ns + (DRAIN_TRIPS * trip_s * 1e9) as i64;
            self.drain_ns = now_ns + (DRAIN_EVERY_S * 1e9) as i64;
            self.least_s = [None, self.least_s[0]];
        }
        if self.marks.is_empty() {
            self.drained_ns = now_ns;
        }
        let is_drained = now_ns < self.drained_ns;
        let has_room = self.under_way() + bytes as f64 + kept <= self.window;
        let may = has_room && self.paced_ns <= now_ns;
        self.is_used |= !may;
        may && !is_drained
    }

    fn least(&self) -> Option<f64> {
        let least = self.least_s.iter().flatten().copied();
        least.reduce(f64::min)
    }

    /// A mark to go along, where one is due. `is_last`: nothing more follows for now.
    pub fn mark(&mut self, now_ns: i64, is_last: bool) -> Option<u64> {
        let unmarked = self.sent - self.marked;
        let marked_ns = self.marked_ns;
        let pause_s = marked_ns.map_or(f64::MAX, |then_ns| seconds(then_ns, now_ns));
        // The first one after a pause shows the link without a queue.
        let is_first = self.marks.is_empty() && unmarked > 0;
        let is_due = is_first || unmarked >= MARK_EVERY || is_last && pause_s >= MARK_PAUSE_S;
        is_due.then(|| {
            self.marked = self.sent;
            self.marked_ns = Some(now_ns);
            self.marks.push_back((self.sent, now_ns));
            self.sent
        })
    }

    /// The answer to a mark came; `held_ns`: how long the other end kept it. What is none of ours
    /// is passed over.
    pub fn answered(&mut self, mark: u64, held_ns: i64, now_ns: i64) {
        // The answer to a later one answers those before.
        let Some(index) = self.marks.iter().position(|(sent, _)| *sent == mark) else {
            return;
        };
        let Some((_, then_ns)) = self.marks.drain(..=index).next_back() else {
            return;
        };
        let took_s = seconds(then_ns.saturating_add(held_ns.max(0)), now_ns);
        let [least_s, _] = &mut self.least_s;
        *least_s = Some(least_s.map_or(took_s, |least| least.min(took_s)));
        let least_s = self.least().unwrap_or(took_s);
        let bytes = mark.saturating_sub(self.arrived) as f64;
        self.arrived = self.arrived.max(mark);
        self.recent.push_back((now_ns, took_s));
        let old = |at_ns: i64| seconds(at_ns, now_ns) > RECENT_S.max(2.0 * least_s);
        while self.recent.front().is_some_and(|(at_ns, _)| old(*at_ns)) {
            self.recent.pop_front();
        }
        let recent = self.recent.iter().map(|(_, took_s)| *took_s);
        let fastest_s = recent.reduce(f64::min).unwrap_or(took_s);
        let free = 1.0 - (took_s - least_s) / QUEUE_S;
        let pause_s = RECENT_S.max(took_s);
        if fastest_s - least_s > QUEUE_S && seconds(self.shrunk_ns, now_ns) > pause_s {
            self.shrunk_ns = now_ns;
            // How much waits is known: it is taken off the window.
            let fitting = (least_s + QUEUE_S) / fastest_s;
            self.window *= fitting.max(SHRINK);
        } else if free > 0.0 && self.is_used {
            // Doubling a round trip until the link's end was found; then in small steps.
            let step = match (self.shrunk_ns, free > EMPTY) {
                (0, _) => 1.0,
                (_, true) => BOLD,
                _ => CAREFUL,
            };
            self.window += step * free * bytes;
        }
        self.window = self.window.clamp(LEAST, MOST);
        self.is_used = false;
    }

    /// What the link takes, bytes a second, as far as is known.
    pub fn rate(&self) -> f64 {
        self.window / (self.least().unwrap_or(0.0) + QUEUE_S)
    }

    /// Since when the oldest mark has no answer, s.
    pub fn silent_s(&self, now_ns: i64) -> f64 {
        let oldest = self.marks.front();
        oldest.map_or(0.0, |(_, then_ns)| seconds(*then_ns, now_ns))
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns).max(0) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A link with a rate in bytes a second and, from a time on, another delay each way; every
    /// n-th message is lost and comes `again_s` later, with all behind it. Gives bytes a second and
    /// the longest queue, both of the second half of a minute.
    fn drive(rate: f64, delay_s: [f64; 2], every: u64, again_s: f64) -> (f64, f64) {
        const SIZE: usize = 700;
        const END_NS: i64 = 120_000_000_000;
        let mut flow = Flow::default();
        let mut answers: VecDeque<(i64, u64)> = VecDeque::new();
        let (mut idle_ns, mut behind_ns, mut worst_s, mut arrived, mut count) =
            (0_i64, 0_i64, 0.0_f64, 0, 0);
        for now_ns in (0..END_NS).step_by(1_000_000) {
            let is_late = now_ns > END_NS / 4;
            let delay_ns = (delay_s[usize::from(is_late)] * 1e9) as i64;
            while let Some((at_ns, mark)) = answers.front().copied() {
                if at_ns > now_ns {
                    break;
                }
                answers.pop_front();
                flow.answered(mark, 0, now_ns);
            }
            while flow.has_room(SIZE, 0.0, now_ns) {
                idle_ns = idle_ns.max(now_ns) + (SIZE as f64 / rate * 1e9) as i64;
                count += 1;
                behind_ns = behind_ns.max(idle_ns + delay_ns);
                if every > 0 && count % every == 0 {
                    behind_ns += (again_s * 1e9) as i64;
                }
                flow.wrote(SIZE, now_ns);
                if now_ns > END_NS / 2 {
                    arrived += SIZE;
                    worst_s = worst_s.max((idle_ns - now_ns) as f64 * 1e-9);
                }
                if let Some(mark) = flow.mark(now_ns, false) {
                    answers.push_back((behind_ns + delay_ns, mark));
                }
            }
        }
        (arrived as f64 / (END_NS / 2) as f64 * 1e9, worst_s)
    }

    #[test]
    fn a_link_is_filled_without_a_queue_also_when_its_delay_changes_and_messages_are_lost() {
        for (rate, delay_s, every, again_s, share) in [
            (8e3, [0.1, 0.1], 0, 0.0, 0.8),
            (64e3, [0.02, 0.02], 0, 0.0, 0.8),
            (64e3, [0.02, 0.3], 0, 0.0, 0.8),
            (64e3, [0.3, 0.02], 0, 0.0, 0.7),
            (4e5, [0.1, 0.1], 0, 0.0, 0.7),
            (64e3, [0.02, 0.02], 40, 0.3, 0.5),
        ] {
            let (used, worst_s) = drive(rate, delay_s, every, again_s);
            println!("{rate} B/s, {delay_s:?} s, {every}: {used:.0}, waits {worst_s:.2} s");
            assert!(used > share * rate, "{rate} {delay_s:?} {every}: {used}");
            let wait_s = worst_s - 2.0 * 700.0 / rate;
            assert!(
                wait_s < 3.0 * QUEUE_S,
                "{rate} {delay_s:?} {every}: {worst_s}"
            );
        }
    }

    #[test]
    fn answers_of_others_and_silence_are_understood() {
        let mut flow = Flow::default();
        assert_eq!(flow.mark(0, true), Some(0), "to see who is there");
        flow.answered(77, 0, 5);
        assert!((flow.silent_s(3_000_000_000) - 3.0).abs() < 1e-9);
        flow.answered(0, 0, 3_000_000_000);
        assert!(flow.silent_s(9_000_000_000) <= 0.0);
        flow.wrote(20_000, 0);
        assert!(!flow.has_urgent_room(2_000.0));
    }
}

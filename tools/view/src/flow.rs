//! How much may be under way to a viewer: as much as its link takes without a queue.
//!
//! A socket's buffer does not show that: most viewers come through ssh, which takes megabytes at
//! once and hands them on as fast as the radio link takes them. So data are followed by pings,
//! whose answers show what has arrived and how long it took. What is under way is steered so that
//! the answer takes a quarter of a second longer than it would without any data (the idea of
//! LEDBAT, RFC 6817). Pure: time comes in.

use std::collections::VecDeque;

/// How long data may wait on their way behind others, s: short against the age at which a pose is
/// shown as old.
const QUEUE_S: f64 = 0.25;
/// Under way at first, bytes: half a second's worth of 200 kbit/s.
const FIRST: f64 = 12_000.0;
/// Under way at least: what keeps the slowest link in use.
const LEAST: f64 = 3_000.0;
/// ... and at most.
const MOST: f64 = 4_000_000.0;
/// A ping, which costs 10 bytes, comes after this many: a tenth of a second on the slowest link.
const PING_EVERY: u64 = 2_000;
/// Share of the window that is enough for a message of any size.
const MOST_OF_IT: f64 = 0.7;
/// Without data there is a ping with this period, s: the link's delay is shown, and a dead viewer
/// is noticed.
const PING_PAUSE_S: f64 = 1.0;
/// A step down leaves at least this share: one answer may come late by itself.
const SHRINK: f64 = 0.6;

/// Share of what arrived by which the window grows once the link's end was found.
const CAREFUL: f64 = 0.25;

/// What is known of the way to one viewer.
#[derive(Debug)]
pub struct Flow {
    /// Bytes handed to the system, and of those the ones known to have arrived.
    sent: u64,
    arrived: u64,
    /// Pings without an answer: bytes sent before, and when.
    pings: VecDeque<(u64, i64)>,
    pinged: u64,
    pinged_ns: Option<i64>,
    /// Shortest and last time from ping to answer, s.
    least_s: Option<f64>,
    last_s: Option<f64>,
    window: f64,
    shrunk_ns: i64,
    /// Whether the window was half used or more since the last answer.
    is_used: bool,
}

impl Default for Flow {
    fn default() -> Self {
        Self {
            sent: 0,
            arrived: 0,
            pings: VecDeque::new(),
            pinged: 0,
            pinged_ns: None,
            least_s: None,
            last_s: None,
            window: FIRST,
            shrunk_ns: 0,
            is_used: false,
        }
    }
}

impl Flow {
    /// This many bytes were handed over.
    pub fn wrote(&mut self, bytes: usize) {
        self.sent += bytes as u64;
        self.is_used |= self.under_way() > self.window * 0.5;
    }

    fn under_way(&self) -> f64 {
        (self.sent - self.arrived) as f64
    }

    /// Whether a message may go now. `beyond`: bytes beside the window that are kept for what
    /// cannot wait.
    pub fn has_room(&self, bytes: usize, beyond: f64) -> bool {
        // One that is larger than the window needs no more than most of it, or it would wait
        // without end.
        let bytes = (bytes as f64).min(MOST_OF_IT * self.window);
        self.under_way() + bytes <= self.window + beyond
    }

    /// A ping's content, where one is due. `last`: nothing more follows for now.
    pub fn ping(&mut self, now_ns: i64, last: bool) -> Option<[u8; 8]> {
        let unmarked = self.sent - self.pinged;
        let pinged_ns = self.pinged_ns;
        let pause_s = pinged_ns.map_or(f64::MAX, |then_ns| seconds(then_ns, now_ns));
        let is_due = unmarked >= PING_EVERY || last && (unmarked > 0 || pause_s >= PING_PAUSE_S);
        is_due.then(|| {
            self.pinged = self.sent;
            self.pinged_ns = Some(now_ns);
            self.pings.push_back((self.sent, now_ns));
            self.sent.to_le_bytes()
        })
    }

    /// An answer came. What is none of ours is passed over.
    pub fn pong(&mut self, content: &[u8], now_ns: i64) {
        let Ok(sent) = content.try_into().map(u64::from_le_bytes) else {
            return;
        };
        // The answer to a later one answers those before.
        let Some(index) = self.pings.iter().position(|(mark, _)| *mark == sent) else {
            return;
        };
        let Some((_, then_ns)) = self.pings.drain(..=index).next_back() else {
            return;
        };
        let took_s = seconds(then_ns, now_ns);
        let least_s = self.least_s.map_or(took_s, |least| least.min(took_s));
        let bytes = sent.saturating_sub(self.arrived) as f64;
        (self.least_s, self.last_s) = (Some(least_s), Some(took_s));
        self.arrived = self.arrived.max(sent);
        let free = 1.0 - (took_s - least_s) / QUEUE_S;
        if free < 0.0 && seconds(self.shrunk_ns, now_ns) > took_s {
            self.shrunk_ns = now_ns;
            // How much waits is known: it is taken off the window.
            let fitting = (least_s + QUEUE_S) / took_s;
            self.window *= fitting.max(SHRINK);
        } else if free > 0.0 && self.is_used {
            // Doubling a round trip until the link's end was found; then in small steps: an answer
            // comes late.
            let step = if self.shrunk_ns == 0 { 1.0 } else { CAREFUL };
            self.window += step * free * bytes;
        }
        self.window = self.window.clamp(LEAST, MOST);
        self.is_used = self.under_way() > self.window * 0.5;
    }

    /// What the link takes, bytes a second, as far as is known.
    pub fn rate(&self) -> f64 {
        self.window / (self.least_s.unwrap_or(0.0) + QUEUE_S)
    }

    /// Time from ping to answer, s: of the last one, or longer where one is waited for longer.
    pub fn round_trip_s(&self, now_ns: i64) -> f64 {
        let last_s = self.last_s.unwrap_or(0.0);
        last_s.max(self.silent_s(now_ns))
    }

    /// Since when the oldest ping has no answer, s.
    pub fn silent_s(&self, now_ns: i64) -> f64 {
        let oldest = self.pings.front();
        oldest.map_or(0.0, |(_, then_ns)| seconds(*then_ns, now_ns))
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns).max(0) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A link with a rate in bytes a second and a delay each way; a viewer that answers at once.
    /// Messages of a size are always waiting. Gives bytes a second, and the longest and the last
    /// wait of a message, s.
    fn drive(size: usize, rate: f64, delay_s: f64, seconds: i64) -> (f64, f64, f64) {
        let mut flow = Flow::default();
        let mut answers: VecDeque<(i64, [u8; 8])> = VecDeque::new();
        let (mut idle_ns, mut worst_s, mut wait_s) = (0_i64, 0.0_f64, 0.0);
        let delay_ns = (delay_s * 1e9) as i64;
        let mut arrived = 0;
        for now_ns in (0..seconds * 1_000_000_000).step_by(1_000_000) {
            while let Some((at_ns, content)) = answers.front().copied() {
                if at_ns > now_ns {
                    break;
                }
                answers.pop_front();
                flow.pong(&content, now_ns);
            }
            while flow.has_room(size, 0.0) {
                idle_ns = idle_ns.max(now_ns) + (size as f64 / rate * 1e9) as i64;
                flow.wrote(size);
                arrived += size;
                wait_s = (idle_ns - now_ns) as f64 * 1e-9;
                if now_ns > 10_000_000_000 {
                    worst_s = worst_s.max(wait_s);
                }
                if let Some(content) = flow.ping(now_ns, false) {
                    answers.push_back((idle_ns + 2 * delay_ns, content));
                }
            }
        }
        (arrived as f64 / seconds as f64, worst_s, wait_s)
    }

    #[test]
    fn a_link_is_filled_without_a_queue() {
        for (size, rate, delay_s) in [
            (4000, 25e3, 0.5),
            (4000, 25e3, 0.25),
            (4000, 25e3, 0.0),
            (4000, 1e6, 0.1),
            (4000, 6e3, 0.3),
            (1000, 25e3, 0.5),
            (8000, 25e3, 0.5),
            (15000, 25e3, 0.5),
        ] {
            let (used, worst_s, last_s) = drive(size, rate, delay_s, 60);
            let case = format!("{size} B, {rate} B/s, {delay_s} s");
            println!("{case}: {used:.0}, waits {worst_s:.2} s, {last_s:.2} s");
            assert!(used > 0.8 * rate, "{case}: {used}");
            // Its own time on the link, that of one before it, and the queue that is asked for.
            let wait_s = worst_s - 2.0 * size as f64 / rate;
            assert!(wait_s < 1.4 * QUEUE_S, "{case}: {worst_s}");
        }
    }

    #[test]
    fn answers_of_others_and_silence_are_understood() {
        let mut flow = Flow::default();
        assert_eq!(flow.ping(0, true), Some([0; 8]), "to see who is there");
        flow.pong(&[1, 2], 5);
        flow.pong(&u64::MAX.to_le_bytes(), 5);
        assert_eq!(flow.silent_s(3_000_000_000), 3.0);
        flow.pong(&[0; 8], 3_000_000_000);
        assert_eq!(flow.silent_s(9_000_000_000), 0.0);
        flow.wrote(20_000);
        assert!(!flow.has_room(1, 2_000.0));
    }
}

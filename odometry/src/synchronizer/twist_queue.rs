//! Twists that wait for the scan they belong to.
//!
//! A robot need not have them, and one whose wheels say nothing must not hold its scans up. So a
//! scan waits for twists only where there were some a while before it: those have come, in
//! whatever order the topics are read. Like its IMU samples it takes them up to the first at or
//! after its sweep's end, and none that was published when the wait for it was over.

use crate::stamps::{STAMPS_NS, is_set_back};
use randt_messages::Twist;
use randt_persist::{Error, Persist, Reader, Writer};
use std::collections::VecDeque;

/// Twists that may wait: 10 s at 200 Hz. A radar that was held up sends its sweep at most that
/// late.
const ROOM: usize = 2048;
/// A twist of this age has come, ns: scans and samples run ahead of each other by less.
const COME_NS: i64 = 1_000_000_000;
/// Wheels of which nothing was measured for this time are none, ns.
const GONE_NS: i64 = 2 * COME_NS;
/// No robot moves faster, m/s and rad/s.
const VELOCITY_MAX: f64 = 100.0;

/// The twists that no scan has taken yet, in the order in which they came.
#[derive(Debug)]
pub struct TwistQueue {
    twists: VecDeque<Twist>,
    /// Stamp of the last one that was taken.
    taken_ns: Option<i64>,
}

impl TwistQueue {
    /// Empty; it never grows.
    pub fn new() -> Self {
        Self {
            twists: VecDeque::with_capacity(ROOM),
            taken_ns: None,
        }
    }

    /// Adds a twist; where there is no room the oldest one is left out, and `false` is given: no
    /// scan has come for a long time.
    pub fn push(&mut self, twist: &Twist) -> bool {
        let is_full = self.twists.len() >= ROOM;
        if is_full {
            self.twists.pop_front();
        }
        self.twists.push_back(*twist);
        !is_full
    }

    /// Takes the oldest twist.
    pub fn pop(&mut self) -> Option<Twist> {
        let twist = self.twists.pop_front()?;
        self.taken_ns = Some(twist.header.stamp_ns);
        Some(twist)
    }

    /// Number of twists.
    pub fn len(&self) -> usize {
        self.twists.len()
    }

    /// Whether there were twists before a sweep that ends at `end_ns`, so that it waits for those
    /// that belong to it.
    fn are_expected(&self, end_ns: i64) -> bool {
        let is_recent = |stamp_ns: i64| stamp_ns > end_ns.saturating_sub(GONE_NS);
        let taken = self.taken_ns.filter(|t| !is_set_back(end_ns, *t));
        let has_come = |twist: &Twist| twist.header.stamp_ns <= end_ns.saturating_sub(COME_NS);
        let come = self.twists.iter().filter(|twist| has_come(twist));
        taken.is_some_and(is_recent) || come.map(|twist| twist.header.stamp_ns).any(is_recent)
    }

    /// How many twists a sweep that ends at `end_ns` takes; `None` where the one that ends the
    /// count has not come yet. One that was published after `deadline_ns` came in vain, and so did
    /// all after it.
    ///
    /// A sweep of before the clock was set back takes no twists of after that, and the other way
    /// round twists of before do not cover a sweep of after it.
    pub fn covering(&self, end_ns: i64, deadline_ns: i64) -> Option<usize> {
        if !self.are_expected(end_ns) {
            let is_old = |twist: &Twist| {
                twist.header.stamp_ns <= end_ns.saturating_sub(GONE_NS)
                    || is_set_back(end_ns, twist.header.stamp_ns)
            };
            return Some(self.twists.iter().take_while(|twist| is_old(twist)).count());
        }
        let mut last_ns = self.taken_ns;
        if last_ns.is_some_and(|t| t >= end_ns && !is_set_back(end_ns, t)) {
            return Some(0);
        }
        for (i, twist) in self.twists.iter().enumerate() {
            let stamp_ns = twist.header.stamp_ns;
            let is_new_time = last_ns.is_some_and(|t| is_set_back(stamp_ns, t));
            let is_old_sweep = last_ns.is_some_and(|t| !is_set_back(end_ns, t));
            if twist.header.published_ns > deadline_ns || is_new_time && is_old_sweep {
                return Some(i);
            }
            if stamp_ns >= end_ns && !is_set_back(end_ns, stamp_ns) {
                return Some(i + 1);
            }
            last_ns = Some(stamp_ns);
        }
        None
    }
}

impl Persist for TwistQueue {
    fn save(&self, out: &mut Writer<'_>) {
        let Self { twists, taken_ns } = self;
        twists.len().save(out);
        twists.iter().for_each(|twist| out.plain(twist));
        taken_ns.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.twists.clear();
        let mut count = 0_usize;
        count.restore(from)?;
        for _ in 0..count {
            let twist = from.plain()?;
            if !is_measurement(&twist) || !self.push(&twist) {
                return Err(Error::Unsound("twists"));
            }
        }
        self.taken_ns.restore(from)?;
        if self.taken_ns.is_some_and(|t| !STAMPS_NS.contains(&t)) {
            return Err(Error::Unsound("stamp of the last twist"));
        }
        Ok(())
    }
}

/// Whether a twist can be a measurement: a possible stamp, and a velocity that a robot can have.
pub fn is_measurement(twist: &Twist) -> bool {
    // NaN compares false.
    STAMPS_NS.contains(&twist.header.stamp_ns)
        && twist.velocity.iter().all(|v| v.abs() <= VELOCITY_MAX)
        && twist.covariance.iter().all(|c| c.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: i64 = 20_000_000;
    const SECOND_NS: i64 = 1_000_000_000;

    fn twist(stamp_ns: i64) -> Twist {
        let mut twist = Twist::default();
        twist.header.stamp_ns = stamp_ns;
        twist.header.published_ns = stamp_ns + 1;
        twist
    }

    /// Twists of two seconds.
    fn queue() -> TwistQueue {
        let mut queue = TwistQueue::new();
        (0..100).for_each(|i| assert!(queue.push(&twist(SECOND_NS + i * STEP_NS))));
        queue
    }

    #[test]
    fn a_sweep_takes_twists_up_to_the_first_at_or_after_its_end() {
        let mut queue = queue();
        let end_ns = SECOND_NS + 70 * STEP_NS;
        assert_eq!(queue.covering(end_ns, i64::MAX), Some(71));
        assert_eq!(queue.covering(end_ns + 1, i64::MAX), Some(72));
        // The fifth one was published too late.
        assert_eq!(queue.covering(end_ns, SECOND_NS + 3 * STEP_NS + 1), Some(4));
        assert_eq!(queue.covering(3 * SECOND_NS, i64::MAX), None);
        (0..72).for_each(|_| assert!(queue.pop().is_some()));
        assert_eq!(queue.covering(end_ns + STEP_NS, i64::MAX), Some(0));
    }

    #[test]
    fn a_sweep_waits_only_where_there_were_twists_a_while_ago() {
        let mut queue = queue();
        // The first one may not have come in another order.
        assert_eq!(queue.covering(SECOND_NS + STEP_NS, i64::MAX), Some(0));
        // They ended two seconds ago: old ones are taken out.
        assert_eq!(queue.covering(6 * SECOND_NS, i64::MAX), Some(100));
        while queue.pop().is_some() {}
        assert_eq!(queue.covering(3 * SECOND_NS + 2 * STEP_NS, i64::MAX), None);
        assert_eq!(queue.covering(5 * SECOND_NS, i64::MAX), Some(0));
    }

    #[test]
    fn twists_of_before_a_clock_was_set_back_do_not_cover() {
        let mut queue = TwistQueue::new();
        queue.taken_ns = Some(100 * SECOND_NS);
        (0..3).for_each(|i| assert!(queue.push(&twist(SECOND_NS + i * STEP_NS))));
        // A sweep of the old time takes none of the new one.
        assert_eq!(queue.covering(101 * SECOND_NS, i64::MAX), Some(0));
    }

    #[test]
    fn what_waits_survives_its_process() {
        let mut whole = queue();
        whole.pop();
        let mut bytes = vec![0; 1 << 16];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = TwistQueue::new();
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.twists, whole.twists);
        assert_eq!(restored.taken_ns, Some(SECOND_NS));
        bytes[8..16].copy_from_slice(&i64::MIN.to_le_bytes());
        bytes[16..24].copy_from_slice(&i64::MIN.to_le_bytes());
        assert!(restored.restore(&mut Reader::new(&bytes)).is_err());
    }
}

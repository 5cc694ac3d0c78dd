//! What did not come: messages missing before one that did, also over restarts of this recorder
//! and of publishers.
//!
//! A publisher gives a reader that joins no more than its history. What a recorder that was away
//! cannot get any more shows in the numbers: the last message in the files of the recorder before,
//! and the first one that this one gets.

use crate::{Positions, Raw};
use randt_messages::{DropCause, LastRecorded, OdometryStateTopic, Topic, health::text_of};
use std::ops::Range;

/// A recorder that has not listened for this time was away: stopped, or starved. Awake it listens
/// five times a second.
const AWAY_NS: i64 = 1_000_000_000;
/// A publisher that died while the recorder was away has its successor within this time after
/// that; systemd and a busy machine need 2.3 s.
const SUCCESSOR_MAX_NS: i64 = 5_000_000_000;
/// States of odometry that goes on are at most this many numbers behind the last one: those that
/// it sends again. Farther back it has begun anew.
const STATES_AGAIN: u64 = 64;
/// The last health message of a recorder that was killed is not counted as missing.
const ITSELF: &str = "recorder";

/// Messages of one topic that are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Why.
    pub cause: DropCause,
    /// How many, as `log/drop` counts them.
    pub count: u64,
    /// When the last one before them was published, ns.
    pub begin_ns: i64,
    /// When the first one behind them was, ns.
    pub end_ns: i64,
}

/// Follows all publishers.
#[derive(Debug)]
pub struct Continuity {
    last: Positions,
    /// Those that came since the last absence: their publishers were still there when it ended.
    received: Positions,
    /// The last absence, ns.
    away: Option<Range<i64>>,
    listened_ns: Option<i64>,
    /// Whether a recorder was here before, whenever that was.
    is_back: bool,
}

impl Continuity {
    /// Goes on after what the files of an earlier recorder hold; nothing is missing for one that
    /// has none.
    pub fn after(recorded: Positions) -> Self {
        let newest_ns = recorded.newest_ns();
        Self {
            last: recorded,
            received: Positions::default(),
            away: None,
            listened_ns: (newest_ns > 0).then_some(newest_ns),
            is_back: newest_ns > 0,
        }
    }

    /// What has come is going to be taken now.
    pub fn listen(&mut self, now_ns: i64) {
        let is_back = std::mem::take(&mut self.is_back);
        if let Some(from_ns) = self.listened_ns.replace(now_ns)
            && (is_back || now_ns - from_ns > AWAY_NS)
        {
            self.away = Some(from_ns..now_ns);
            self.received = Positions::default();
        }
    }

    /// Takes a message; gives what is missing before it. A publisher's messages come in the order
    /// of their numbers.
    pub fn take(&mut self, raw: &Raw) -> Option<Gap> {
        let message = Positions::position_of(raw)?;
        let gap = self.gap(&message);
        self.last.put(message);
        self.received.put(message);
        gap
    }

    fn gap(&self, message: &LastRecorded) -> Option<Gap> {
        // Where nothing was recorded before, nothing is missing.
        let last = self.last.last(message)?;
        let (cause, count) = if message.epoch == last.epoch {
            let count = message.sequence.saturating_sub(last.sequence + 1);
            (DropCause::Missed, count)
        } else if message.epoch < last.epoch {
            // What was on its way when its publisher was replaced.
            return None;
        } else {
            self.before_first_of(message, last)
        };
        (count > 0).then_some(Gap {
            cause,
            count,
            begin_ns: last.published_ns,
            end_ns: message.published_ns,
        })
    }

    /// What is missing before the first message of a publisher's new process.
    fn before_first_of(&self, message: &LastRecorded, last: &LastRecorded) -> (DropCause, u64) {
        let is_numbered = message.id.max(last.id) > 0;
        let has_begun_anew = text_of(&message.topic) == OdometryStateTopic::NAME
            && message.id + STATES_AGAIN < last.id;
        if is_numbered && !has_begun_anew {
            return (DropCause::Missed, message.id.saturating_sub(last.id + 1));
        }
        match message.sequence {
            0 if self.is_end_unknown(message, last) => (DropCause::Replaced, 1),
            missed => (DropCause::Missed, missed),
        }
    }

    /// Whether a publisher may have sent something before its end that did not come. `message`:
    /// the first of its successor, whose epoch is the time when that began.
    fn is_end_unknown(&self, message: &LastRecorded, last: &LastRecorded) -> bool {
        let received = self.received.last(last);
        let was_received = received.is_some_and(|received| received.epoch == last.epoch);
        let began_ns = i64::try_from(message.epoch).unwrap_or(i64::MAX);
        let began_then =
            |away: &Range<i64>| (away.start..away.end + SUCCESSOR_MAX_NS).contains(&began_ns);
        text_of(&last.writer) != ITSELF
            && !was_received
            && self.away.as_ref().is_some_and(began_then)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{ImuSampleTopic, Message, StageHealthTopic, health::fixed_text};

    const S: i64 = 1_000_000_000;

    fn sample(epoch: i64, sequence: u64, published_ns: i64) -> Raw {
        let mut sample = Message::<ImuSampleTopic>::default();
        let header = &mut sample.head.header;
        (header.epoch, header.sequence) = (epoch as u64, sequence);
        header.published_ns = published_ns;
        Raw::from_message(sample.as_ref())
    }

    fn state(epoch: i64, sequence: u64, id: u64) -> Raw {
        let mut state = Message::<OdometryStateTopic>::default();
        let header = &mut state.head.header;
        (header.epoch, header.sequence) = (epoch as u64, sequence);
        header.published_ns = id as i64 * S / 5;
        state.head.id = id;
        Raw::from_message(state.as_ref())
    }

    /// What the files of an earlier recorder hold.
    fn recorded(raws: &[Raw]) -> Continuity {
        let mut positions = Positions::default();
        raws.iter()
            .filter_map(Positions::position_of)
            .for_each(|last| positions.put(last));
        Continuity::after(positions)
    }

    fn missing(continuity: &mut Continuity, raw: Raw) -> Option<(DropCause, u64)> {
        continuity.take(&raw).map(|gap| (gap.cause, gap.count))
    }

    #[test]
    fn the_first_recorder_misses_nothing_of_what_was_before_it() {
        let mut continuity = recorded(&[]);
        continuity.listen(100 * S);
        assert_eq!(missing(&mut continuity, sample(S, 5000, 99 * S)), None);
        assert_eq!(missing(&mut continuity, sample(S, 5001, 99 * S)), None);
        let gap = continuity.take(&sample(S, 5004, 100 * S)).unwrap();
        let (begin_ns, end_ns) = (99 * S, 100 * S);
        let cause = DropCause::Missed;
        let count = 2;
        assert_eq!(
            gap,
            Gap {
                cause,
                count,
                begin_ns,
                end_ns
            }
        );
    }

    #[test]
    fn a_recorder_that_comes_back_misses_what_the_history_does_not_reach() {
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        // Within reach: what is in the files already comes again.
        assert_eq!(missing(&mut continuity, sample(S, 4998, 90 * S)), None);
        assert_eq!(missing(&mut continuity, sample(S, 5001, 91 * S)), None);
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        let found = missing(&mut continuity, sample(S, 5051, 99 * S));
        assert_eq!(found, Some((DropCause::Missed, 50)));
    }

    #[test]
    fn a_publisher_that_was_replaced_meanwhile_lost_an_unknown_number() {
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        let found = missing(&mut continuity, sample(95 * S, 0, 96 * S));
        assert_eq!(found, Some((DropCause::Replaced, 1)));
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(90 * S + S / 2);
        let found = missing(&mut continuity, sample(90 * S + S / 4, 0, 91 * S));
        assert_eq!(
            found,
            Some((DropCause::Replaced, 1)),
            "also within a second"
        );
        // Its successor's beginning is out of reach too.
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        let found = missing(&mut continuity, sample(91 * S, 70, 99 * S));
        assert_eq!(found, Some((DropCause::Missed, 70)));
    }

    #[test]
    fn a_publisher_that_is_replaced_while_the_recorder_listens_loses_nothing() {
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        // It was still there.
        assert_eq!(missing(&mut continuity, sample(S, 5000, 90 * S)), None);
        continuity.listen(100 * S + S / 5);
        assert_eq!(missing(&mut continuity, sample(101 * S, 0, 101 * S)), None);
        // Long after the absence: nothing had been sent when it ended.
        let mut continuity = recorded(&[sample(S, 5000, 90 * S)]);
        continuity.listen(100 * S);
        let later = sample(160 * S, 0, 160 * S);
        assert_eq!(missing(&mut continuity, later), None);
    }

    #[test]
    fn a_recorder_that_is_stopped_for_long_was_away_too() {
        let mut continuity = recorded(&[]);
        continuity.listen(10 * S);
        assert_eq!(missing(&mut continuity, sample(S, 7, 10 * S)), None);
        continuity.listen(15 * S);
        let found = missing(&mut continuity, sample(12 * S, 0, 13 * S));
        assert_eq!(found, Some((DropCause::Replaced, 1)));
    }

    #[test]
    fn a_recorder_that_was_killed_does_not_miss_its_own_last_message() {
        let health = |name: &str, epoch: i64| {
            let mut health = Message::<StageHealthTopic>::default();
            health.head.name = fixed_text(name);
            let header = &mut health.head.header;
            (header.epoch, header.published_ns) = (epoch as u64, epoch);
            Raw::from_message(health.as_ref())
        };
        for (name, expected) in [
            ("recorder", None),
            ("mapper", Some((DropCause::Replaced, 1))),
        ] {
            let mut continuity = recorded(&[health(name, 90 * S)]);
            continuity.listen(100 * S);
            assert_eq!(missing(&mut continuity, health(name, 95 * S)), expected);
        }
    }

    #[test]
    fn states_are_followed_by_their_own_numbers_over_restarts_of_odometry() {
        // Odometry sends its last 32 states again.
        let mut continuity = recorded(&[state(S, 100, 100)]);
        continuity.listen(40 * S);
        assert_eq!(missing(&mut continuity, state(30 * S, 0, 90)), None);
        assert_eq!(missing(&mut continuity, state(30 * S, 1, 91)), None);
        let mut continuity = recorded(&[state(S, 100, 100)]);
        continuity.listen(40 * S);
        let found = missing(&mut continuity, state(30 * S, 3, 121));
        assert_eq!(found, Some((DropCause::Missed, 20)));
        // Odometry without its saved state numbers anew.
        let mut continuity = recorded(&[state(S, 100, 100)]);
        continuity.listen(40 * S);
        let found = missing(&mut continuity, state(30 * S, 4, 4));
        assert_eq!(found, Some((DropCause::Missed, 4)));
    }
}

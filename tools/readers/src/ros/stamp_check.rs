//! Stamps that are not those of their neighbours, by when the messages were recorded.

use crate::counters::Counters;

/// Largest change of a stream's stamps against the time of recording, ns. Recorders take messages
/// late by the second when disks are busy; a wrong stamp is off by more.
const CHANGE_MAX_NS: i64 = 5_000_000_000;

/// Messages in a row that agree on another offset, from which the clock was set, and the stamps are
/// right.
const AGREEING: usize = 4;

/// Judges the stamps of one stream.
#[derive(Clone, Debug, Default)]
pub(super) struct StampCheck {
    /// Stamp minus time of recording, ns, of the last message that was good.
    offset_ns: Option<i64>,
    /// The same of those behind it that are not.
    odd_ns: Vec<i64>,
}

impl StampCheck {
    /// Begins with what most of the first messages agree on: stamps and times of recording, ns.
    pub fn new(first: impl Iterator<Item = (i64, i64)>) -> Self {
        let mut offsets: Vec<i64> = first.map(|(stamp, arrival)| stamp - arrival).collect();
        offsets.sort_unstable();
        Self {
            offset_ns: offsets.get(offsets.len() / 2).copied(),
            odd_ns: Vec::new(),
        }
    }

    /// Whether a message is to be used; otherwise it is counted.
    pub fn accepts(
        &mut self,
        (stamp_ns, arrival_ns): (i64, i64),
        what: &str,
        counters: &mut Counters,
    ) -> bool {
        let offset_ns = stamp_ns - arrival_ns;
        let known_ns = *self.offset_ns.get_or_insert(offset_ns);
        if offset_ns.abs_diff(known_ns) <= CHANGE_MAX_NS as u64 {
            self.offset_ns = Some(offset_ns);
            self.odd_ns.clear();
            return true;
        }
        let agrees = |odd: &i64| odd.abs_diff(offset_ns) <= CHANGE_MAX_NS as u64;
        self.odd_ns.retain(agrees);
        self.odd_ns.push(offset_ns);
        if self.odd_ns.len() >= AGREEING {
            self.offset_ns = Some(offset_ns);
            self.odd_ns.clear();
            return true;
        }
        counters.count_loss("stamps_off", 1, || {
            format!(
                "{what}: stamp {stamp_ns} is {:.1} s off those of its neighbours, by when it was recorded",
                (offset_ns - known_ns) as f64 * 1e-9
            )
        });
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accepted(offsets: &[i64]) -> Vec<bool> {
        let messages = (0..).zip(offsets).map(|(i, offset)| {
            let arrival_ns = i * 200_000_000;
            (arrival_ns + offset * 1_000_000_000, arrival_ns)
        });
        let mut counters = Counters::default();
        let mut check = StampCheck::new(messages.clone().take(8));
        let accepted = messages.map(|message| check.accepts(message, "radar", &mut counters));
        accepted.collect()
    }

    #[test]
    fn single_stamps_are_refused_and_a_clock_that_was_set_is_not() {
        let day = 86_400;
        assert_eq!(
            accepted(&[day, 0, 0, -day, day, 0, 0, 0]),
            [false, true, true, false, false, true, true, true]
        );
        let mut set = vec![0; 8];
        set.extend([day; 6]);
        let refused = accepted(&set).iter().filter(|accepted| !**accepted).count();
        assert_eq!(refused, AGREEING - 1);
        // A disk that is busy, and a sensor of another clock.
        assert!(
            accepted(&[0, 0, -2, -1, 0])
                .iter()
                .all(|accepted| *accepted)
        );
        assert!(accepted(&[day; 9]).iter().all(|accepted| *accepted));
    }
}

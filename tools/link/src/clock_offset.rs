//! How far the other machine's clock is ahead of this one's.

use std::collections::VecDeque;

/// Answers that are kept: of these the fastest one says it best.
const KEPT: usize = 64;

/// Answers to frames, with how long each took.
#[derive(Debug, Default)]
pub struct ClockOffset {
    /// Round trip and offset, ns.
    answers: VecDeque<(i64, i64)>,
}

impl ClockOffset {
    /// An answer came. `sent_ns`, `now_ns`: by this clock; `came_ns`, `answered_ns`: by the other.
    pub fn push(&mut self, sent_ns: i64, came_ns: i64, answered_ns: i64, now_ns: i64) {
        let trip_ns = now_ns
            .saturating_sub(sent_ns)
            .saturating_sub(answered_ns.saturating_sub(came_ns));
        if trip_ns < 0 {
            return;
        }
        let there = came_ns.saturating_sub(sent_ns);
        let back = answered_ns.saturating_sub(now_ns);
        self.answers
            .push_back((trip_ns, (there / 2).saturating_add(back / 2)));
        if self.answers.len() > KEPT {
            self.answers.pop_front();
        }
    }

    /// The offset and by how much it may be off, ns.
    pub fn estimate_ns(&self) -> Option<(i64, i64)> {
        let (trip_ns, offset_ns) = self.answers.iter().min()?;
        Some((*offset_ns, trip_ns / 2))
    }

    /// The fastest answer, ns.
    pub fn trip_ns(&self) -> Option<i64> {
        self.answers.iter().map(|answer| answer.0).min()
    }

    /// Another machine is at the other end.
    pub fn clear(&mut self) {
        self.answers.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_answer_says_it_best() {
        let mut clock = ClockOffset::default();
        let ahead_ns = 5_000_000_000;
        for late_ns in [700, 3, 90_000] {
            // There it takes 10 and as much as it is late, back 10; it is held for 1000.
            let came = 10 + late_ns + ahead_ns;
            clock.push(0, came, came + 1000, 1020 + late_ns);
        }
        let (offset_ns, off_ns) = clock.estimate_ns().unwrap_or_default();
        assert!(
            (offset_ns - ahead_ns).abs() <= off_ns && off_ns < 20,
            "{offset_ns} {off_ns}"
        );
    }
}

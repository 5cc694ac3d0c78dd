//! Brings sweeps and IMU samples of a log into one order of stamps, reading a bounded stretch
//! ahead.

use crate::{Counter, Error, Event, InputInfo, Source};
use std::collections::VecDeque;

/// How far to read on for the other stream, ns of stamps. A driver delivers a sweep within a turn
/// of its end, a recorder writes it soon after; the slowest radar of ours turns in 0.25 s.
const AHEAD_NS: i64 = 1_000_000_000;
/// Most sweeps held (a sweep of 10,000 returns has 136 kB), and most IMU samples (8 s at 1 kHz).
const SWEEPS_MAX: usize = 32;
const SAMPLES_MAX: usize = 8192;

/// A source whose streams are each in the log's order and merged by their stamps.
///
/// Equal stamps: truth, then IMU and twists, then the sweep, so that a sweep finds its last IMU
/// sample there. For twists nothing waits: a robot need not have them.
pub(crate) struct InOrder<S> {
    inner: S,
    truth: VecDeque<Event>,
    samples: VecDeque<Event>,
    twists: VecDeque<Event>,
    sweeps: VecDeque<Event>,
    newest_ns: i64,
    ended: bool,
}

impl<S: Source> InOrder<S> {
    pub fn new(inner: S) -> Self {
        Self {
            inner,
            truth: VecDeque::new(),
            samples: VecDeque::new(),
            twists: VecDeque::new(),
            sweeps: VecDeque::new(),
            newest_ns: i64::MIN,
            ended: false,
        }
    }

    /// Whether the oldest event held can be given out.
    fn is_decided(&self) -> bool {
        if self.ended || (!self.samples.is_empty() && !self.sweeps.is_empty()) {
            return true;
        }
        if self.sweeps.len() >= SWEEPS_MAX
            || self.samples.len().max(self.twists.len()) >= SAMPLES_MAX
        {
            return true;
        }
        self.oldest_ns()
            .is_some_and(|oldest| self.newest_ns.saturating_sub(oldest) > AHEAD_NS)
    }

    fn oldest_ns(&self) -> Option<i64> {
        let heads = [
            self.truth.front(),
            self.samples.front(),
            self.twists.front(),
            self.sweeps.front(),
        ];
        heads.into_iter().flatten().map(Event::stamp_ns).min()
    }

    fn take_oldest(&mut self) -> Option<Event> {
        // Streams of two clocks never meet: then neither may wait for the other without end.
        if self.sweeps.len() >= SWEEPS_MAX {
            return self.sweeps.pop_front();
        }
        let oldest = self.oldest_ns()?;
        let queues = [
            &mut self.truth,
            &mut self.samples,
            &mut self.twists,
            &mut self.sweeps,
        ];
        let queue = queues
            .into_iter()
            .find(|q| q.front().is_some_and(|e| e.stamp_ns() == oldest))?;
        queue.pop_front()
    }
}

impl<S: Source> Source for InOrder<S> {
    fn info(&self) -> &InputInfo {
        self.inner.info()
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        while !self.is_decided() {
            let Some(event) = self.inner.next_event()? else {
                self.ended = true;
                break;
            };
            self.newest_ns = event.stamp_ns();
            match event {
                Event::Scan(_) => self.sweeps.push_back(event),
                Event::Imu(_) => self.samples.push_back(event),
                Event::Twist(_) => self.twists.push_back(event),
                Event::Truth(_) => self.truth.push_back(event),
            }
        }
        Ok(self.take_oldest())
    }

    fn counters(&self) -> Vec<Counter> {
        self.inner.counters()
    }
}

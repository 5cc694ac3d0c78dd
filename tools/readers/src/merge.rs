//! Brings sweeps and IMU samples of a log into one order of stamps, reading a bounded stretch
//! ahead.

use crate::{Counter, Error, Event, InputInfo, Source, counters::Counters};
use std::collections::VecDeque;

/// How far to read on for the other stream, ns of stamps. A driver delivers a sweep within a turn
/// of its end, a recorder writes it soon after; the slowest radar of ours turns in 0.25 s.
const AHEAD_NS: i64 = 1_000_000_000;
/// Most sweeps held (a sweep of 10,000 returns has 136 kB), and most IMU samples (8 s at 1 kHz).
const SWEEPS_MAX: usize = 32;
const SAMPLES_MAX: usize = 8192;

/// A stamp that is off by more than [`AHEAD_NS`] is a stray where this many or fewer come in a
/// row, and those before and behind them are in order.
const STRAYS_MAX: usize = 3;

/// A single sweep that is not between its neighbours would begin a new frame, however little it is
/// off; of samples, which a network may bring out of order, odometry leaves out what it cannot
/// use.
const SINGLE_SWEEP_NS: i64 = 0;

/// How many of a queue's events before its last one are strays: outside the time from the one
/// before them, which may have been given out already, to the last one. A single one is a stray
/// also where it is off by less than [`AHEAD_NS`], but more than `single_ns`.
fn strays(queue: &VecDeque<Event>, given_ns: Option<i64>, single_ns: i64) -> usize {
    let mut stamps = queue.iter().rev().map(Event::stamp_ns);
    let Some(last_ns) = stamps.next() else {
        return 0;
    };
    let is_far = |stamp_ns: i64, far_ns: i64| stamp_ns.abs_diff(last_ns) > far_ns as u64;
    let far: Vec<i64> = stamps
        .clone()
        .take_while(|ns| is_far(*ns, AHEAD_NS))
        .collect();
    let is_single = |ns: &i64| far.is_empty() && is_far(*ns, single_ns);
    let single = stamps.clone().next().filter(is_single);
    let run: Vec<i64> = far.iter().copied().chain(single).collect();
    let before_ns = stamps.nth(run.len()).or(given_ns);
    let is_before = |ns: &i64| *ns <= last_ns && !is_far(*ns, AHEAD_NS);
    let Some(before_ns) = before_ns.filter(is_before) else {
        return 0;
    };
    let between = before_ns..=last_ns;
    let are_strays = run.len() <= STRAYS_MAX && run.iter().all(|ns| !between.contains(ns));
    if are_strays { run.len() } else { 0 }
}

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
    /// The last sweep and the last sample that were given out.
    given_ns: [Option<i64>; 2],
    counters: Counters,
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
            given_ns: [None; 2],
            counters: Counters::default(),
            ended: false,
        }
    }

    /// Whether the oldest event held can be given out.
    fn is_decided(&self) -> bool {
        // The one behind shows whether a stamp is a stray.
        if self.ended || (self.samples.len() > 1 && self.sweeps.len() > 1) {
            return true;
        }
        if self.sweeps.len() >= SWEEPS_MAX
            || self.samples.len().max(self.twists.len()) >= SAMPLES_MAX
        {
            return true;
        }
        let is_past = |oldest| self.newest_ns.saturating_sub(oldest) > AHEAD_NS;
        !self.may_have_stray() && self.oldest_ns().is_some_and(is_past)
    }

    /// Whether the only event of a stream is far behind the one before it: the next one shows
    /// whether it is a stray.
    fn may_have_stray(&self) -> bool {
        let [sweep_ns, sample_ns] = self.given_ns;
        let streams = [
            (&self.sweeps, sweep_ns, SINGLE_SWEEP_NS),
            (&self.samples, sample_ns, AHEAD_NS),
        ];
        streams.into_iter().any(|(queue, given_ns, single_ns)| {
            let head_ns = queue.front().map(Event::stamp_ns);
            let behind = given_ns.zip(head_ns);
            queue.len() == 1 && behind.is_some_and(|(given, head)| given - head > single_ns)
        })
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

    /// Drops strays before the event that came last.
    fn drop_strays(&mut self) {
        let [sweep_ns, sample_ns] = self.given_ns;
        for (queue, given_ns, single_ns) in [
            (&mut self.sweeps, sweep_ns, SINGLE_SWEEP_NS),
            (&mut self.samples, sample_ns, AHEAD_NS),
        ] {
            let count = strays(queue, given_ns, single_ns);
            let last = queue.pop_back();
            for _ in 0..count {
                let stray_ns = queue.pop_back().map(|event| event.stamp_ns());
                let next_ns = last.as_ref().map(Event::stamp_ns);
                self.counters.count_loss("stamps_off", 1, || {
                    format!(
                        "stamp {} does not stand between its neighbours; the next one is {}",
                        stray_ns.unwrap_or_default(),
                        next_ns.unwrap_or_default()
                    )
                });
            }
            queue.extend(last);
        }
    }
}

impl<S: Source> Source for InOrder<S> {
    fn info(&self) -> &InputInfo {
        self.inner.info()
    }

    fn set_bin_size(&mut self, size_m: f64) {
        self.inner.set_bin_size(size_m);
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
            self.drop_strays();
        }
        let event = self.take_oldest();
        match &event {
            Some(Event::Scan(scan)) => self.given_ns[0] = Some(scan.head.header.stamp_ns),
            Some(Event::Imu(sample)) => self.given_ns[1] = Some(sample.header.stamp_ns),
            _ => {}
        }
        Ok(event)
    }

    fn counters(&self) -> Vec<Counter> {
        let mut counters = self.inner.counters();
        counters.extend(self.counters.list());
        counters
    }
}

//! A source whose events a fault has changed.

use randt_readers::{Counter, Error, Event, InputInfo, Source};

/// Changes an event at its time since the drive's begin, s; whether the event stays.
pub type Change = Box<dyn FnMut(&mut Event, f64) -> bool>;

/// A fault with its times.
pub struct Injection {
    change: Change,
    /// Onset and end since the drive's begin, s.
    during_s: Option<[f64; 2]>,
}

/// Onset and end of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Its first instant.
    pub begin_ns: i64,
    /// Its last instant; far in the future where it has none.
    pub end_ns: i64,
}

impl Injection {
    /// A fault; with onset and end, s since the drive's begin, where it has any.
    pub fn new(change: Change, during_s: Option<[f64; 2]>) -> Self {
        Self { change, during_s }
    }
}

/// The source.
pub struct FaultInjector<S> {
    source: S,
    injection: Injection,
    begin_ns: Option<i64>,
}

impl<S: Source> FaultInjector<S> {
    /// A source with a fault.
    pub fn new(source: S, injection: Injection) -> Self {
        Self {
            source,
            injection,
            begin_ns: None,
        }
    }

    /// When the fault is there; none where it always is, and before the first event.
    pub fn span(&self) -> Option<Span> {
        let [begin, end] = self.injection.during_s?.map(|s| (s * 1e9) as i64);
        let drive_ns = self.begin_ns?;
        Some(Span {
            begin_ns: drive_ns.saturating_add(begin),
            end_ns: drive_ns.saturating_add(end),
        })
    }
}

impl<S: Source> Source for FaultInjector<S> {
    fn info(&self) -> &InputInfo {
        self.source.info()
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        while let Some(mut event) = self.source.next_event()? {
            let stamp_ns = event.stamp_ns();
            let begin_ns = *self.begin_ns.get_or_insert(stamp_ns);
            let at_s = (stamp_ns - begin_ns) as f64 * 1e-9;
            if (self.injection.change)(&mut event, at_s) {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    fn counters(&self) -> Vec<Counter> {
        self.source.counters()
    }
}

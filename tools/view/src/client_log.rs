//! Rate limit of journal lines about clients: a few lines a minute for each kind of event, and the
//! number of suppressed ones. Every client can connect, but none may fill the journal by it.

use std::collections::BTreeMap;

/// Lines are counted over this time, ns.
const MINUTE_NS: i64 = 60_000_000_000;

/// What happens to a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// It watches.
    Watches,
    /// It watched, and is gone.
    Gone,
    /// A foreign page.
    Origin,
    /// A host name that is not ours.
    Host,
    /// No request of a viewer.
    Request,
    /// No handshake, or none in time.
    Handshake,
    /// There is no room for it.
    Crowd,
    /// It could not be taken from the system.
    Accept,
}

impl Event {
    /// Its name in counts.
    fn name(self) -> &'static str {
        match self {
            Self::Watches => "came",
            Self::Gone => "gone",
            Self::Origin => "by origin",
            Self::Host => "by host",
            Self::Request => "by request",
            Self::Handshake => "no handshake",
            Self::Crowd => "no room",
            Self::Accept => "not accepted",
        }
    }

    fn is_refusal(self) -> bool {
        !matches!(self, Self::Watches | Self::Gone)
    }

    /// Lines a minute. Viewers are few, and their addresses are worth knowing.
    fn lines_max(self) -> u32 {
        if self.is_refusal() { 1 } else { 16 }
    }
}

/// Counters of each kind of event.
#[derive(Debug, Default)]
pub(crate) struct ClientLog {
    counters: BTreeMap<Event, EventCounter>,
}

#[derive(Clone, Copy, Debug, Default)]
struct EventCounter {
    /// All events since the start.
    total: u64,
    /// Events without a line yet.
    suppressed: u64,
    /// Lines since the minute began.
    lines: u32,
    begin_ns: i64,
}

impl EventCounter {
    /// Whether one more line is allowed now.
    fn takes_line(&mut self, lines_max: u32, now_ns: i64) -> bool {
        let is_over = now_ns.saturating_sub(self.begin_ns) >= MINUTE_NS;
        if self.lines == 0 || is_over {
            (self.lines, self.begin_ns) = (0, now_ns);
        }
        let is_free = self.lines < lines_max;
        self.lines += u32::from(is_free);
        is_free
    }
}

impl ClientLog {
    /// Counts an event, and writes a line where one is allowed.
    pub fn record(
        &mut self,
        event: Event,
        text: &str,
        now_ns: i64,
        log_line: &mut dyn FnMut(&str),
    ) {
        let counter = self.counters.entry(event).or_default();
        counter.total += 1;
        if !counter.takes_line(event.lines_max(), now_ns) {
            counter.suppressed += 1;
            return;
        }
        match std::mem::take(&mut counter.suppressed) {
            0 => log_line(text),
            more => log_line(&format!("{text} (and {more} more before)")),
        }
    }

    /// Writes the number of suppressed events when their minute is over.
    pub fn catch_up(&mut self, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        for (event, counter) in &mut self.counters {
            if counter.suppressed > 0 && counter.takes_line(event.lines_max(), now_ns) {
                let more = std::mem::take(&mut counter.suppressed);
                log_line(&format!("clients {}: {more} more", event.name()));
            }
        }
    }

    /// Numbers of refused clients by reason; empty where there are none.
    pub fn refused(&self) -> String {
        let refused = self.counters.iter().filter(|(event, _)| event.is_refusal());
        let parts = refused.map(|(event, counter)| format!("{} {}", counter.total, event.name()));
        parts.collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn a_flood_is_a_line_a_minute_and_nothing_is_lost() {
        let mut log = ClientLog::default();
        let mut lines = Vec::new();
        for i in 0..90_000 {
            let now_ns = i * S / 1000;
            let mut log_line = |line: &str| lines.push((now_ns, line.to_owned()));
            log.catch_up(now_ns, &mut log_line);
            log.record(Event::Origin, "a page", now_ns, &mut log_line);
            if i % 30_000 == 0 {
                log.record(Event::Host, "a name", now_ns, &mut log_line);
            }
        }
        log.catch_up(200 * S, &mut |line| lines.push((200 * S, line.to_owned())));
        log.catch_up(201 * S, &mut |line| lines.push((201 * S, line.to_owned())));
        let expected = [
            (0, "a page"),
            (0, "a name"),
            (60 * S, "clients by origin: 59999 more"),
            (60 * S, "clients by host: 1 more"),
            (200 * S, "clients by origin: 30000 more"),
            (200 * S, "clients by host: 1 more"),
        ];
        let expected = expected.map(|(at, line)| (at, line.to_owned()));
        assert_eq!(lines, expected);
        assert_eq!(log.refused(), "90000 by origin, 3 by host");
    }

    #[test]
    fn viewers_are_named_one_by_one_as_long_as_they_are_few() {
        let mut log = ClientLog::default();
        let mut lines = 0;
        for i in 0..100 {
            log.record(Event::Watches, "it", i, &mut |_| lines += 1);
        }
        assert_eq!((lines, log.refused().as_str()), (16, ""));
        log.record(Event::Gone, "it", 0, &mut |_| lines += 1);
        assert_eq!(lines, 17);
    }
}

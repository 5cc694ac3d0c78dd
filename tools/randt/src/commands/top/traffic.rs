//! Rate, age and losses of every topic, from what the stages report of their ports.
//!
//! No topic has to be read for that: a reader of its own would take a slot and memory from the
//! pipeline.

use super::snapshot::TopicRow;
use randt_messages::{
    BUS_TOPICS, PortHealth, StageHealth, StageHealthTopic, Topic, health::text_of,
};
use std::collections::{BTreeMap, VecDeque};

/// Rates are those of this time.
const WINDOW_NS: i64 = 3_000_000_000;
/// A stage that has been silent for this time will not be asked what it has sent since.
pub const SILENT_NS: i64 = 1_500_000_000;

/// All ports of all stages.
#[derive(Debug, Default)]
pub struct Traffic {
    /// By topic, stage, and whether it publishes.
    ports: BTreeMap<(String, String, bool), Port>,
}

#[derive(Debug, Default)]
struct Port {
    epoch: u64,
    lost: u64,
    counts: VecDeque<Count>,
}

/// What a port had sent or received when its stage reported it.
#[derive(Clone, Copy, Debug)]
struct Count {
    reported_ns: i64,
    messages: u64,
    published_ns: i64,
}

impl Traffic {
    /// Takes the report of a stage.
    pub fn push(&mut self, health: &StageHealth) {
        let header = &health.header;
        // The health messages themselves are not in its list of ports.
        let own = PortHealth {
            topic: randt_messages::health::fixed_text(StageHealthTopic::NAME),
            messages: header.sequence + 1,
            last_published_ns: header.published_ns,
            publishes: 1,
            ..PortHealth::default()
        };
        for port in health.ports().iter().chain([&own]) {
            let (topic, stage) = (text_of(&port.topic), text_of(&health.name));
            let key = (topic.to_owned(), stage.to_owned(), port.publishes == 1);
            let known = self.ports.entry(key).or_default();
            known.push(header.epoch, header.stamp_ns, port);
        }
    }

    /// The topics, in the order of the data's way.
    pub fn topics(&self, now_ns: i64) -> Vec<TopicRow> {
        let mut rows: Vec<TopicRow> = Vec::new();
        for ((topic, _, publishes), port) in &self.ports {
            if rows.last().is_none_or(|row| row.name != *topic) {
                rows.push(TopicRow {
                    name: topic.clone(),
                    rate_hz: 0.0,
                    age_s: None,
                    lost: 0,
                });
            }
            let Some(row) = rows.last_mut() else { continue };
            if *publishes {
                row.rate_hz += port.rate_hz(now_ns);
            } else {
                row.lost += port.lost;
            }
            let ages_s = [row.age_s, port.age_s(now_ns)].into_iter().flatten();
            row.age_s = ages_s.min_by(f64::total_cmp);
        }
        let index = |row: &TopicRow| BUS_TOPICS.iter().position(|topic| topic.name == row.name);
        rows.sort_by_key(|row| index(row).unwrap_or(usize::MAX));
        rows
    }
}

impl Port {
    fn push(&mut self, epoch: u64, reported_ns: i64, port: &PortHealth) {
        if self.epoch != epoch {
            *self = Self {
                epoch,
                ..Self::default()
            };
        }
        self.lost = port.lost;
        self.counts.push_back(Count {
            reported_ns,
            messages: port.messages,
            published_ns: port.last_published_ns,
        });
        let is_over = |count: &Count| reported_ns - count.reported_ns > WINDOW_NS;
        while self.counts.front().is_some_and(is_over) {
            self.counts.pop_front();
        }
    }

    /// Until when it is known what went through.
    fn known_ns(&self, now_ns: i64) -> i64 {
        match self.counts.back() {
            Some(last) if now_ns - last.reported_ns < SILENT_NS => last.reported_ns,
            _ => now_ns,
        }
    }

    /// Messages over the time that they took: counting them over the time between two reports of
    /// the stage would be off by one either way.
    fn rate_hz(&self, now_ns: i64) -> f64 {
        let (Some(first), Some(last)) = (self.counts.front(), self.counts.back()) else {
            return 0.0;
        };
        let known_ns = self.known_ns(now_ns);
        let messages = last.messages.saturating_sub(first.messages) as f64;
        if messages == 0.0 || known_ns - last.published_ns > WINDOW_NS {
            return 0.0;
        }
        let from_ns = match first.messages {
            0 => first.reported_ns,
            _ => first.published_ns,
        };
        let span_ns = (last.published_ns - from_ns).max(1) as f64;
        let silence_ns = (known_ns - last.published_ns) as f64;
        // What is overdue has not come.
        let is_overdue = silence_ns > 2.0 * span_ns / messages;
        1e9 * messages / (span_ns + if is_overdue { silence_ns } else { 0.0 })
    }

    fn age_s(&self, now_ns: i64) -> Option<f64> {
        let last = self.counts.back().filter(|last| last.messages > 0)?;
        Some((self.known_ns(now_ns) - last.published_ns).max(0) as f64 * 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::health::fixed_text;

    const MS: i64 = 1_000_000;

    /// A stage whose port has seen a message every `period` ms since the beginning.
    fn word(name: &str, at_ms: i64, period: i64, publishes: bool, lost: u64) -> StageHealth {
        let mut health = StageHealth {
            name: fixed_text(name),
            port_count: 1,
            ..StageHealth::default()
        };
        health.header.epoch = 1;
        health.header.stamp_ns = at_ms * MS;
        health.header.published_ns = at_ms * MS;
        health.header.sequence = (at_ms / 500).unsigned_abs();
        health.ports[0] = PortHealth {
            topic: fixed_text("radar/scan/v1"),
            messages: (at_ms / period).unsigned_abs(),
            last_published_ns: at_ms / period * period * MS,
            lost,
            publishes: u64::from(publishes),
        };
        health
    }

    fn scan(traffic: &Traffic, now_ms: i64) -> TopicRow {
        let rows = traffic.topics(now_ms * MS);
        assert_eq!(rows.last().unwrap().name, "stage/health/v1");
        rows.into_iter()
            .find(|row| row.name == "radar/scan/v1")
            .unwrap()
    }

    #[test]
    fn every_registered_topic_that_a_stage_reads_is_a_row() {
        let mut health = word("recorder", 0, 1, false, 0);
        health.port_count = BUS_TOPICS.len() as u32;
        for (port, topic) in health.ports.iter_mut().zip(BUS_TOPICS) {
            port.topic = fixed_text(topic.name);
            assert!(topic.name.len() <= 20, "too wide for the table");
        }
        let mut traffic = Traffic::default();
        traffic.push(&health);
        let rows = traffic.topics(0).into_iter().map(|row| row.name);
        assert!(rows.eq(BUS_TOPICS.iter().map(|topic| topic.name)));
    }

    #[test]
    fn a_rate_is_exact_however_few_messages_there_were() {
        let mut traffic = Traffic::default();
        for at_ms in [400, 900, 1400, 1900] {
            traffic.push(&word("play", at_ms, 210, true, 0));
            traffic.push(&word("filter", at_ms + 7, 210, false, 3));
        }
        let row = scan(&traffic, 2000);
        assert!((row.rate_hz - 1000.0 / 210.0).abs() < 1e-9, "{row:?}");
        // 9 x 210 = 1890 ms, known at 1900 and 1907 ms.
        assert!((row.age_s.unwrap() - 0.010).abs() < 1e-9, "{row:?}");
        assert_eq!(row.lost, 3);
        let health = traffic.topics(2000 * MS).pop().unwrap();
        assert!((health.rate_hz - 4.0).abs() < 1e-6, "{health:?}");
    }

    #[test]
    fn what_stops_coming_has_no_rate_and_an_age() {
        let mut traffic = Traffic::default();
        for at_ms in [500, 1000, 1500, 2000] {
            traffic.push(&word("play", at_ms, 100, true, 0));
        }
        assert!((scan(&traffic, 2100).rate_hz - 10.0).abs() < 1e-9);
        // The stage hangs: what it sends is not reported any more.
        let row = scan(&traffic, 4000);
        assert!(row.rate_hz < 5.0 && row.rate_hz > 0.0, "{row:?}");
        assert!((row.age_s.unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(scan(&traffic, 6000).rate_hz, 0.0);
        // It comes back and counts anew.
        let mut back = word("play", 7000, 7000, true, 0);
        back.header.epoch = 2;
        traffic.push(&back);
        let row = scan(&traffic, 7100);
        assert_eq!((row.rate_hz, row.age_s), (0.0, Some(0.0)));
    }

    #[test]
    fn a_topic_that_nobody_writes_is_as_old_as_its_readers_report() {
        let mut traffic = Traffic::default();
        let mut waiting = word("filter", 500, 1000, false, 0);
        traffic.push(&waiting);
        let row = scan(&traffic, 600);
        assert_eq!((row.rate_hz, row.age_s), (0.0, None));
        waiting = word("filter", 1500, 1000, false, 0);
        traffic.push(&waiting);
        assert_eq!(scan(&traffic, 1600).age_s, Some(0.5));
    }
}

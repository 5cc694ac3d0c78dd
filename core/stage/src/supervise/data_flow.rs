//! Whether a stage's data flow, as text for `systemctl status`: a process that hangs cannot report
//! that, its readers can.

use randt_messages::{
    ImuSampleTopic, Keyframe, MapperGraph, OdometryStateTopic, PortHealth, RadarPoints, RadarScan,
    Topic, health::text_of,
};
use std::collections::VecDeque;

/// Data that come always are stale when none has come for this time.
const STALE_NS: i64 = 1_000_000_000;
/// Health messages whose times are kept for the rate: five seconds of them.
const KEPT: usize = 10;

/// A stage's main data are the first of these that it has a port for: topic, name of one message,
/// and whether they come always. Keyframes come only while the robot moves.
const MAIN_DATA: [(&str, &str, bool); 4] = [
    (RadarPoints::NAME, "scan", true),
    (RadarScan::NAME, "scan", true),
    (Keyframe::NAME, "keyframe", false),
    (ImuSampleTopic::NAME, "IMU sample", true),
];

/// Data that come always while scans come, to stages that read them, and the name of one message.
const SIDE_DATA: [(&str, &str); 3] = [
    (ImuSampleTopic::NAME, "IMU sample"),
    (OdometryStateTopic::NAME, "pose"),
    (MapperGraph::NAME, "mapper status"),
];

/// The rate of a stage's main data, from its ports' counters.
#[derive(Debug, Default)]
pub(crate) struct DataFlow {
    /// When the newest message was published, ns, and how many there were.
    seen: VecDeque<(i64, u64)>,
}

impl DataFlow {
    /// The text, and whether data are fresh. `note`: what the stage adds; `trouble`: the message
    /// of its status.
    pub(crate) fn describe(
        &mut self,
        now_ns: i64,
        ports: &[PortHealth],
        note: &str,
        trouble: &str,
    ) -> (String, bool) {
        let mut parts = Vec::new();
        let mut is_fresh = true;
        if let Some((port, one, comes_always)) = main_data(ports) {
            let age_s = seconds(now_ns - port.last_published_ns);
            is_fresh = !(comes_always && now_ns - port.last_published_ns > STALE_NS);
            parts.push(match port.messages {
                0 => format!("no {one} yet"),
                _ if !is_fresh => format!("stale: no {one} for {age_s:.1} s"),
                _ if comes_always => {
                    let rate = self.rate_hz(port);
                    let rate = rate.map_or(String::new(), |hz| format!("{hz:.1} Hz, "));
                    format!("{rate}last {one} {age_s:.1} s ago")
                }
                _ => format!("last {one} {age_s:.1} s ago"),
            });
            let missing = missing(ports, port);
            is_fresh &= missing.is_none();
            parts.extend(missing);
        }
        if !note.is_empty() {
            parts.push(note.to_owned());
        }
        let flow = parts.join(", ");
        let text = match (flow.is_empty(), trouble.is_empty()) {
            (false, false) => format!("{flow}; {trouble}"),
            (true, true) => "running".to_owned(),
            _ => flow + trouble,
        };
        (text, is_fresh)
    }

    /// Messages per second, by their own times: a history that is delivered at once was sent over
    /// seconds.
    fn rate_hz(&mut self, port: &PortHealth) -> Option<f64> {
        let newest = (port.last_published_ns, port.messages);
        if self.seen.back().is_none_or(|last| last.1 != newest.1) {
            self.seen.push_back(newest);
        }
        if self.seen.len() > KEPT {
            self.seen.pop_front();
        }
        let oldest = self.seen.front()?;
        let span_ns = newest.0 - oldest.0;
        (span_ns > 0).then(|| (newest.1 - oldest.1) as f64 / (span_ns as f64 * 1e-9))
    }
}

fn main_data(ports: &[PortHealth]) -> Option<(&PortHealth, &'static str, bool)> {
    MAIN_DATA.iter().find_map(|(topic, one, comes_always)| {
        let port = ports.iter().find(|port| text_of(&port.topic) == *topic)?;
        Some((port, *one, *comes_always))
    })
}

/// What is missing beside the main data. What else a stage reads is read with the scans, so that
/// its age counts from the last scan.
fn missing(ports: &[PortHealth], main: &PortHealth) -> Option<String> {
    SIDE_DATA.iter().find_map(|(topic, one)| {
        let reads = |port: &&PortHealth| text_of(&port.topic) == *topic && port.publishes == 0;
        let port = ports.iter().find(reads)?;
        if port.topic == main.topic || main.messages == 0 {
            return None;
        }
        let behind_ns = main.last_published_ns - port.last_published_ns;
        match port.messages {
            0 if *topic == ImuSampleTopic::NAME => Some(format!("no {one} yet")),
            0 => None,
            _ if behind_ns > STALE_NS => Some(format!("no {one} for {:.1} s", seconds(behind_ns))),
            _ => None,
        }
    })
}

fn seconds(ns: i64) -> f64 {
    ns.max(0) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::health::fixed_text;

    const S: i64 = 1_000_000_000;

    fn port(topic: &str, messages: u64, last_published_ns: i64) -> PortHealth {
        PortHealth {
            topic: fixed_text(topic),
            messages,
            last_published_ns,
            ..PortHealth::default()
        }
    }

    #[test]
    fn a_status_has_rate_age_and_what_the_stage_adds() {
        let mut flow = DataFlow::default();
        let at = |n: i64| [port(RadarPoints::NAME, 30 + 5 * n as u64, 100 * S + n * S)];
        flow.describe(100 * S, &at(0), "", "");
        let (text, is_fresh) = flow.describe(101 * S + S / 10, &at(1), "trust good", "");
        assert_eq!(text, "5.0 Hz, last scan 0.1 s ago, trust good");
        assert!(is_fresh);
        let (text, is_fresh) = flow.describe(104 * S + S / 5, &at(1), "", "3 scans never came");
        assert_eq!(text, "stale: no scan for 3.2 s; 3 scans never came");
        assert!(!is_fresh);
    }

    #[test]
    fn a_driver_reports_what_is_missing() {
        let ports = [port(RadarScan::NAME, 0, 0)];
        let (text, _) = DataFlow::default().describe(S, &ports, "", "10.0.0.1: no answer");
        assert_eq!(text, "no scan yet; 10.0.0.1: no answer");
    }

    #[test]
    fn an_imu_is_missed_only_where_scans_come() {
        let text = |scan: PortHealth, imu: PortHealth, now_ns| {
            DataFlow::default().describe(now_ns, &[scan, imu], "", "").0
        };
        let scan = port(RadarPoints::NAME, 9, 10 * S);
        let imu = |messages, at_ns| port(ImuSampleTopic::NAME, messages, at_ns);
        let found = text(scan, imu(0, 0), 10 * S);
        assert_eq!(found, "last scan 0.0 s ago, no IMU sample yet");
        let found = text(scan, imu(5, 7 * S), 10 * S);
        assert_eq!(found, "last scan 0.0 s ago, no IMU sample for 3.0 s");
        let found = text(scan, imu(5, 10 * S), 14 * S);
        assert_eq!(found, "stale: no scan for 4.0 s");
    }

    #[test]
    fn odometry_that_hangs_is_missed_by_the_recorder_and_a_mapper_that_never_ran_is_not() {
        let scan = port(RadarPoints::NAME, 9, 10 * S);
        let pose = port(OdometryStateTopic::NAME, 3, 8 * S);
        let mapper = port(MapperGraph::NAME, 0, 0);
        let (text, is_fresh) = DataFlow::default().describe(10 * S, &[scan, pose, mapper], "", "");
        assert_eq!(text, "last scan 0.0 s ago, no pose for 2.0 s");
        assert!(!is_fresh);
    }

    #[test]
    fn keyframes_may_stay_away() {
        let ports = [port(Keyframe::NAME, 4, 10 * S)];
        let (text, is_fresh) = DataFlow::default().describe(70 * S, &ports, "4 keyframes", "");
        assert_eq!(text, "last keyframe 60.0 s ago, 4 keyframes");
        assert!(is_fresh);
    }
}

//! Velocities in bags.

use super::support::*;
use crate::{Event, Options, open};

#[test]
fn twists_are_read_from_the_topic_that_is_named_and_from_no_other() {
    let (velocity, first_ns) = ([0.5, -0.25, 0.125], 1_700_000_000_000_000_000);
    for (style, name) in [(Style::Ros1, "a.bag"), (Style::CdrLittle, "a.mcap")] {
        for type_name in [ODOMETRY, TWIST, TWIST_WITH_COVARIANCE] {
            let mut messages = recording(style, &CloudLayout::AS_PUBLISHED, 10);
            let stamps = (1..=20).map(|i| first_ns + i * 50_000_000);
            messages.extend(stamps.map(|stamp_ns| TestMessage {
                topic: "/wheels",
                type_name,
                arrival_ns: stamp_ns,
                bytes: match type_name {
                    ODOMETRY => odometry(style, stamp_ns, velocity),
                    _ => twist(
                        style,
                        stamp_ns,
                        velocity,
                        type_name == TWIST_WITH_COVARIANCE,
                    ),
                },
            }));
            messages.sort_by_key(|message| message.arrival_ns);
            let bytes = match style {
                Style::Ros1 => ros1_bag(&messages, "none", 50),
                _ => mcap_bag(&messages, 10_000),
            };
            let (_folder, path) = file(name, &bytes);
            let twists = |options: &Options| {
                let (events, source) = read_with(&path, options);
                assert!(source.counters().iter().all(|c| !c.loss), "{type_name}");
                let twists = events.into_iter().filter_map(|event| match event {
                    Event::Twist(twist) => Some(twist),
                    _ => None,
                });
                twists.collect::<Vec<_>>()
            };
            assert!(twists(&Options::default()).is_empty());
            let named = |topic: &str| Options {
                twist_topic: Some(topic.to_owned()),
                ..Options::default()
            };
            let read = twists(&named("/wheels"));
            assert_eq!(
                (read.len(), read[0].velocity),
                (20, velocity),
                "{type_name}"
            );
            assert!(read.is_sorted_by_key(|twist| twist.header.stamp_ns));
            let variances = [0, 4, 8].map(|i| read[0].covariance[i]);
            let expected = match type_name {
                TWIST => [0.0; 3],
                _ => [0.01, 0.02, 0.06],
            };
            assert_eq!(variances, expected);
            assert!(open(&path, &named("/imu/data")).is_err());
        }
    }
}

//! The layout in docs/view shows every topic, live and recorded, and no other.

use randt_foxglove_schemas::ViewerTopic;
use randt_foxglove_schemas::topic::recorded_channels;
use randt_log::Channel;
use randt_messages::{OdometryStateTopic, Topic};
use serde_json::Value;

const LAYOUT: &str = include_str!("../../../../docs/view/lichtblick.json");

/// Everything in a layout that has the name of a viewer's topic.
fn topics(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(entries) => {
            found.extend(
                entries
                    .keys()
                    .filter(|key| key.starts_with("view/"))
                    .cloned(),
            );
            entries.values().for_each(|value| topics(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| topics(value, found)),
        Value::String(text) if text.starts_with("view/") => found.push(text.clone()),
        _ => {}
    }
}

#[test]
fn the_layout_shows_every_topic_and_no_other() {
    let layout: Value = serde_json::from_str(LAYOUT).unwrap();
    let mut found = Vec::new();
    topics(&layout, &mut found);
    let recorded = recorded_channels();
    let recorded = recorded.iter().map(|channel| channel.topic.as_str());
    let live = ViewerTopic::ALL.map(ViewerTopic::name);
    let known: Vec<&str> = live.into_iter().chain(recorded).collect();
    let plotted = OdometryStateTopic::NAME;
    for topic in known.iter().filter(|topic| **topic != plotted) {
        assert!(found.iter().any(|name| name == topic), "{topic}");
    }
    for name in &found {
        assert!(known.contains(&name.as_str()), "{name}");
    }
    for topic in ViewerTopic::ALL {
        let number = topic.channel_id();
        assert_eq!(ViewerTopic::from_channel_id(number), Some(topic));
    }
    // Each panel has its settings.
    let mut panels = Vec::new();
    panels_of(&layout["layout"], &mut panels);
    assert_eq!(
        panels.len(),
        layout["configById"].as_object().unwrap().len()
    );
    for name in panels {
        assert!(layout["configById"][name].is_object(), "{name}");
    }
}

#[test]
fn what_the_layout_plots_are_numbers_of_a_state() {
    let layout: Value = serde_json::from_str(LAYOUT).unwrap();
    let schema = Channel::from_topic::<OdometryStateTopic>().schema;
    let schema = String::from_utf8(schema).unwrap();
    let panels = layout["configById"].as_object().unwrap().values();
    let paths = panels.filter_map(|panel| panel["paths"].as_array());
    let mut plotted = 0;
    for path in paths.flatten() {
        let path = path["value"].as_str().unwrap();
        let field = path.strip_prefix(OdometryStateTopic::NAME).unwrap();
        let field = field.strip_prefix('.').unwrap();
        let name = field.split('[').next().unwrap();
        let line = schema
            .lines()
            .find(|line| line.split(' ').nth(1) == Some(name));
        let is_array = line.unwrap().contains('[');
        assert_eq!(is_array, field.contains('['), "{path}");
        plotted += 1;
    }
    assert!(plotted > 5);
}

/// The panels of a layout, which are the leaves of its tree.
fn panels_of<'a>(layout: &'a Value, found: &mut Vec<&'a str>) {
    match layout {
        Value::String(panel) => found.push(panel),
        tree => ["first", "second"]
            .map(|side| &tree[side])
            .into_iter()
            .for_each(|side| panels_of(side, found)),
    }
}

//! The layout in docs/view shows every topic, and no other.

use randt_foxglove_schemas::ViewerTopic;
use serde_json::Value;

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
    let layout = include_str!("../../../../docs/view/lichtblick.json");
    let layout: Value = serde_json::from_str(layout).unwrap();
    let mut found = Vec::new();
    topics(&layout, &mut found);
    for topic in ViewerTopic::ALL {
        assert!(found.iter().any(|name| name == topic.name()), "{topic:?}");
        assert_eq!(
            ViewerTopic::from_channel_id(topic.channel_id()),
            Some(topic)
        );
    }
    for name in found {
        assert!(
            ViewerTopic::ALL.iter().any(|topic| topic.name() == name),
            "{name}"
        );
    }
    // Each panel of the layout has its settings.
    for panel in ["first", "second"] {
        let name = layout["layout"][panel].as_str().unwrap();
        assert!(layout["configById"][name].is_object(), "{name}");
    }
}

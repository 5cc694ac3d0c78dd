//! The viewers' protocol over WebSocket: a server's messages, and those of a viewer's that matter
//! to it.
//!
//! Source: docs/spec.md of foxglove/ws-protocol (version 1). Pure. Responsible for bytes and text
//! only.

use base64::{Engine, engine::general_purpose::STANDARD};
use randt_log::Channel;
use serde_json::{Value, json};

/// The names that this protocol goes by: that of newer Foxglove, that of Lichtblick.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// A binary message's first byte, from the server: a message of a channel ...
const MESSAGE_DATA: u8 = 1;
/// ... and the time.
const TIME: u8 = 2;

/// The first of the names that a viewer offers, separated by commas, which we speak.
pub fn choose(offered: &str) -> Option<&'static str> {
    let mut offered = offered.split(',').map(str::trim);
    offered.find_map(|name| SUBPROTOCOLS.into_iter().find(|ours| *ours == name))
}

/// The server's name and capabilities. `session`: another one when the server is another one, so
/// that viewers forget what they had.
pub fn server_info(session: &str) -> String {
    json!({
        "op": "serverInfo",
        "name": format!("randt-view {}", randt_version::VERSION),
        // The viewer's clock is the robot's: its own may be hours off.
        "capabilities": ["time"],
        "supportedEncodings": [],
        "metadata": {},
        "sessionId": session,
    })
    .to_string()
}

/// A channel that can be subscribed to.
pub fn advertise(id: u32, channel: &Channel) -> String {
    // A schema that is text goes as it is.
    let schema = match channel.schema_encoding.as_str() {
        "ros2msg" => String::from_utf8_lossy(&channel.schema).into_owned(),
        _ => STANDARD.encode(&channel.schema),
    };
    json!({
        "op": "advertise",
        "channels": [{
            "id": id,
            "topic": channel.topic,
            "encoding": channel.message_encoding,
            "schemaName": channel.type_name,
            "schemaEncoding": channel.schema_encoding,
            "schema": schema,
        }],
    })
    .to_string()
}

/// A warning in the viewer's list of problems.
pub fn warning(message: &str) -> String {
    json!({ "op": "status", "level": 1, "message": message }).to_string()
}

/// A channel's message for a subscription.
pub fn message_data(subscription: u32, log_time_ns: i64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + payload.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(log_time_ns.max(0).to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// The time.
pub fn time(now_ns: i64) -> Vec<u8> {
    let mut bytes = vec![TIME];
    bytes.extend(now_ns.max(0).to_le_bytes());
    bytes
}

/// What a viewer wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Messages of channels: the subscription's number, and the channel's.
    Subscribe(Vec<(u32, u32)>),
    /// No more of these subscriptions.
    Unsubscribe(Vec<u32>),
    /// Something that we do not offer.
    Other,
}

/// Reads a viewer's message. One that cannot be parsed is ignored.
pub fn request(text: &str) -> Request {
    let Ok(message) = serde_json::from_str::<Value>(text) else {
        return Request::Other;
    };
    let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
    let list = |key: &str| {
        message
            .get(key)
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
    };
    match message.get("op").and_then(Value::as_str) {
        Some("subscribe") => {
            let pair =
                |entry: &Value| Some((number(entry.get("id")?)?, number(entry.get("channelId")?)?));
            Request::Subscribe(list("subscriptions").filter_map(pair).collect())
        }
        Some("unsubscribe") => {
            Request::Unsubscribe(list("subscriptionIds").filter_map(number).collect())
        }
        _ => Request::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn viewers_of_both_kinds_are_served() {
        assert_eq!(
            choose("foxglove.websocket.v1"),
            Some("foxglove.websocket.v1")
        );
        assert_eq!(choose("x, foxglove.sdk.v1"), Some("foxglove.sdk.v1"));
        assert_eq!(choose("foxglove.sdk.v2,mqtt"), None);
        assert_eq!(choose(""), None);
    }

    #[test]
    fn messages_are_those_of_the_specification() {
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":-1,"channelId":2},{"id":1}]}"#;
        assert_eq!(request(subscribe), Request::Subscribe(vec![(0, 3)]));
        let unsubscribe = r#"{"op":"unsubscribe","subscriptionIds":[7,"x",1e99,8]}"#;
        assert_eq!(request(unsubscribe), Request::Unsubscribe(vec![7, 8]));
        for other in ["", "null", "[]", r#"{"op":7}"#, r#"{"op":"getParameters"}"#] {
            assert_eq!(request(other), Request::Other, "{other}");
        }
        let bytes = message_data(0x0102_0304, 5, &[9, 8]);
        assert_eq!(bytes, [1, 4, 3, 2, 1, 5, 0, 0, 0, 0, 0, 0, 0, 9, 8]);
        assert_eq!(time(-1), [2, 0, 0, 0, 0, 0, 0, 0, 0]);
        let channel = Channel {
            topic: "a/b".to_owned(),
            schema: vec![1, 2, 3],
            ..Channel::default()
        };
        let advertised: Value = serde_json::from_str(&advertise(4, &channel)).unwrap();
        assert_eq!(advertised["channels"][0]["schema"], "AQID");
        assert_eq!(advertised["channels"][0]["id"], 4);
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".*", op in "(un)?subscribe", id in any::<i128>()) {
            request(&text);
            choose(&text);
            let value = text.replace(['"', '\\'], "");
            request(&format!(r#"{{"op":"{op}","subscriptions":[{{"id":{id},"channelId":"{value}"}}]}}"#));
            request(&format!(r#"{{"op":"{op}","subscriptionIds":[{id},{value}]}}"#));
        }
    }
}

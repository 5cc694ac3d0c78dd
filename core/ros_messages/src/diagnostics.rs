//! `diagnostic_msgs/DiagnosticArray`: how a stage is.

use crate::definition::Definition;
use crate::pen::{Pen, Style};
use randt_messages::health::text_of;
use randt_messages::{StageHealth, StageState};

/// Its type.
pub const DIAGNOSTICS: Definition = Definition {
    package: "diagnostic_msgs",
    name: "DiagnosticArray",
    md5: "60810da900de1dd6ddd437c3503511da",
    text: "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    inside: &[
        "diagnostic_msgs/DiagnosticStatus\nbyte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
        "diagnostic_msgs/KeyValue\nstring key\nstring value\n",
    ],
};

const OK: u8 = 0;
const WARN: u8 = 1;

/// The health of one stage: state, message, restarts, and what its ports have lost.
pub fn diagnostics(style: Style, health: &StageHealth) -> Vec<u8> {
    let state = StageState::from_code(health.state);
    let mut pen = Pen::new(style);
    pen.header(health.header.sequence, health.header.stamp_ns, "");
    pen.u32(1);
    pen.u8(match state {
        StageState::Degraded => WARN,
        _ => OK,
    });
    pen.string(&format!("randt: {}", text_of(&health.name)));
    let message = text_of(&health.message);
    pen.string(if message.is_empty() {
        state.as_str()
    } else {
        message
    });
    pen.string("");
    let mut values = vec![
        ("state".to_owned(), state.as_str().to_owned()),
        ("restarts".to_owned(), health.restarts.to_string()),
        ("messages lost".to_owned(), health.lost.to_string()),
    ];
    values.extend(health.ports().iter().map(|port| {
        let topic = text_of(&port.topic);
        let counts = format!("{} messages, {} lost", port.messages, port.lost);
        (topic.to_owned(), counts)
    }));
    pen.u32(values.len() as u32);
    for (key, value) in &values {
        pen.string(key);
        pen.string(value);
    }
    pen.end()
}

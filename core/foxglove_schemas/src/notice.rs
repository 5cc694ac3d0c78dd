//! `Log`: what is missing, as a line of text.

use crate::timestamp;
use foxglove::messages::Log;
use foxglove::messages::log::Level;
use randt_messages::{DropCause, LogDrop, health::text_of};

/// What a log does not have, and why.
pub fn of_drop(drop: &LogDrop) -> Log {
    let span_s = (drop.end_ns - drop.begin_ns) as f64 * 1e-9;
    Log {
        timestamp: timestamp(drop.header.stamp_ns),
        level: Level::Warning as i32,
        message: format!(
            "{} of {} not recorded within {span_s:.3} s: {}",
            drop.count,
            text_of(&drop.topic),
            DropCause::from_code(drop.cause).name()
        ),
        name: "recorder".to_owned(),
        ..Log::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::health::fixed_text;

    #[test]
    fn it_says_what_how_many_and_why() {
        let drop = LogDrop {
            begin_ns: 1_000_000_000,
            end_ns: 1_600_000_000,
            count: 3,
            topic: fixed_text("radar/scan/v1"),
            cause: DropCause::Slow as u32,
            ..LogDrop::default()
        };
        let text = of_drop(&drop).message;
        assert_eq!(
            text,
            "3 of radar/scan/v1 not recorded within 0.600 s: disk too slow"
        );
    }
}

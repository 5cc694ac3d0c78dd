//! The anchor of the one clock: it must be there while stages live, and be of this boot.

use super::finding::Finding;
use super::snapshot::DomainSnapshot;
use crate::date::nanoseconds;
use crate::units::seconds;
use rustix::time::ClockId;
use std::fs;

/// A system clock that was set by more is worth a word.
const SET_S: f64 = 1.0;

/// Whether the anchor is there and good.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "clock";
    let path = snapshot.domain.run().join("clock-anchor");
    let shown = path.display();
    let lives = snapshot.living().next().is_some();
    let anew = format!("stop all stages, rm -f {shown}, start them again");
    let anchor_ns = match fs::read_to_string(&path) {
        Ok(text) => text.trim().parse::<i64>().ok(),
        Err(_) if !lives => {
            let text = "the first stage that starts takes the anchor";
            return vec![Finding::ok(ABOUT, text)];
        }
        Err(cause) => {
            let text =
                format!("{shown}: {cause}: a stage that starts now has other stamps than the rest");
            return vec![Finding::bad(ABOUT, text, anew)];
        }
    };
    let Some(anchor_ns) = anchor_ns else {
        let text = format!("{shown} holds no number");
        return vec![Finding::bad(ABOUT, text, anew)];
    };
    let now_ns = nanoseconds(ClockId::Boottime) + anchor_ns;
    let off_s = (now_ns - nanoseconds(ClockId::Realtime)) as f64 * 1e-9;
    if off_s.abs() < SET_S {
        let text = format!("{shown} agrees with the system's clock");
        return vec![Finding::ok(ABOUT, text)];
    }
    let off = seconds(off_s.abs());
    let text = format!(
        "stamps are {off} off the system's clock: it was set since, or {shown} is of another boot"
    );
    let fix = format!("nothing, if it was set: stamps do not step; else {anew}");
    vec![Finding::warn(ABOUT, text, fix)]
}

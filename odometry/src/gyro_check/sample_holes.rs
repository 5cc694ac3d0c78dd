//! Whether the IMU's clock may have stepped: where samples lack.

use crate::gyro_integrator::Turn;
use randt_persist::persist;

/// Samples that lack over this time, s, may be lost, or the clock has stepped.
const STEP_MIN_S: f64 = 0.05;
/// What lacks again within this time, ns, is a bad line's, and no clock that steps.
const BAD_LINE_NS: i64 = 20_000_000_000;

/// The last hole in the samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct SampleHoles {
    /// Until when they lacked, ns.
    end_ns: Option<i64>,
    /// Whether the clock may have stepped then.
    may_have_stepped: bool,
}

persist!(SampleHoles {
    end_ns,
    may_have_stepped
});

impl SampleHoles {
    /// Takes the turn over a span of time, ns; `had_samples`: there were some before. Gives whether
    /// the clock may have stepped in it.
    pub fn observe(&mut self, turn: Option<Turn>, span_ns: (i64, i64), had_samples: bool) -> bool {
        let (begin_ns, end_ns) = span_ns;
        let lacks = turn.is_some_and(|turn| turn.uncovered_s > STEP_MIN_S);
        if !lacks || !had_samples && self.end_ns.is_none() {
            return false;
        }
        let last_ns = self.end_ns.replace(end_ns);
        let since_ns = last_ns.map_or(i64::MAX, |last_ns| begin_ns.saturating_sub(last_ns));
        // A hole that goes on stays what it was.
        if since_ns > 0 {
            self.may_have_stepped = since_ns > BAD_LINE_NS;
        }
        self.may_have_stepped
    }

    /// Until when the samples lacked, ns, where the clock may have stepped.
    pub fn step_ns(&self) -> Option<i64> {
        self.end_ns.filter(|_| self.may_have_stepped)
    }
}

//! A rate that is kept: what is spent comes back with time.

/// What may go at once after a pause, s of the rate.
const BURST_S: f64 = 0.25;

/// Bytes that may be sent.
#[derive(Debug)]
pub struct Bucket {
    /// Bytes a second; `None` for no limit.
    rate: Option<f64>,
    bytes: f64,
    then_ns: i64,
}

impl Bucket {
    /// Full. 0 bytes a second is no limit.
    pub fn new(rate: f64) -> Self {
        let rate = (rate > 0.0).then_some(rate);
        Self {
            rate,
            bytes: rate.unwrap_or(0.0) * BURST_S,
            then_ns: i64::MIN,
        }
    }

    /// Whether something may go now. It may be larger than what is there: that comes off later.
    pub fn has_some(&mut self, now_ns: i64) -> bool {
        let Some(rate) = self.rate else { return true };
        let passed_s = now_ns.saturating_sub(self.then_ns).max(0) as f64 * 1e-9;
        self.bytes = (self.bytes + passed_s * rate).min(rate * BURST_S);
        self.then_ns = now_ns;
        self.bytes > 0.0
    }

    /// That went.
    pub fn spend(&mut self, bytes: usize) {
        self.bytes -= bytes as f64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_kept_over_pauses_and_without_one_there_is_no_limit() {
        let mut bucket = Bucket::new(1000.0);
        let mut sent = 0;
        for now_ns in (0..10_000_000_000).step_by(1_000_000) {
            // Silence for the first half.
            if now_ns >= 5_000_000_000 && bucket.has_some(now_ns) {
                bucket.spend(100);
                sent += 100;
            }
        }
        assert!((5000..=5400).contains(&sent), "{sent}");
        let mut free = Bucket::new(0.0);
        free.spend(1 << 30);
        assert!(free.has_some(0));
    }
}

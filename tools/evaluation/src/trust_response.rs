//! How trust follows what happens: how often it changes, and how long it takes.

/// Trust of one scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanTrust {
    /// Stamp of the scan.
    pub stamp_ns: i64,
    /// Trust as its code: any two that differ are a change.
    pub trust: u32,
    /// Whether it is good.
    pub good: bool,
}

/// Changes of trust a minute; `None` for a drive without duration.
pub fn changes_per_minute(scans: &[ScanTrust]) -> Option<f64> {
    let (first, last) = (scans.first()?, scans.last()?);
    let minutes = (last.stamp_ns - first.stamp_ns) as f64 / 60e9;
    let changes = scans.windows(2).filter(|pair| match pair {
        [a, b] => a.trust != b.trust,
        _ => false,
    });
    (minutes > 0.0).then(|| changes.count() as f64 / minutes)
}

/// Seconds from an instant until the first scan from then on that is good, or not; `None` where no
/// scan up to `end_ns` is.
pub fn seconds_until(scans: &[ScanTrust], good: bool, from_ns: i64, end_ns: i64) -> Option<f64> {
    let first = scans.partition_point(|scan| scan.stamp_ns < from_ns);
    let later = scans.iter().skip(first);
    let mut until = later.take_while(|scan| scan.stamp_ns <= end_ns);
    let found = until.find(|scan| scan.good == good)?;
    Some((found.stamp_ns - from_ns) as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// A scan a second, good but for these.
    fn scans(poor: std::ops::Range<i64>) -> Vec<ScanTrust> {
        let scan = |second| ScanTrust {
            stamp_ns: second * SECOND_NS,
            trust: if poor.contains(&second) { 1 } else { 2 },
            good: !poor.contains(&second),
        };
        (0..=60).map(scan).collect()
    }

    #[test]
    fn every_change_counts() {
        assert_eq!(changes_per_minute(&scans(20..30)), Some(2.0));
        assert_eq!(changes_per_minute(&scans(0..0)), Some(0.0));
        assert_eq!(changes_per_minute(&[]), None);
    }

    #[test]
    fn it_takes_as_long_as_no_scan_differs() {
        let scans = scans(20..30);
        let until = |good, from_s: i64, end_s: i64| {
            seconds_until(&scans, good, from_s * SECOND_NS, end_s * SECOND_NS)
        };
        assert_eq!(until(false, 18, 60), Some(2.0));
        assert_eq!(until(false, 25, 60), Some(0.0));
        assert_eq!(until(false, 30, 60), None);
        assert_eq!(until(false, 10, 19), None);
        assert_eq!(until(true, 25, 60), Some(5.0));
    }
}

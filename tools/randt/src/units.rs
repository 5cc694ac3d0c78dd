//! Numbers with their units, for people.

/// Bytes.
pub fn bytes(bytes: u64) -> String {
    let bytes = bytes as f64;
    if bytes < 999.5e3 {
        format!("{:.0} kB", bytes * 1e-3)
    } else if bytes < 999.95e6 {
        format!("{:.1} MB", bytes * 1e-6)
    } else {
        format!("{:.2} GB", bytes * 1e-9)
    }
}

/// A time that has passed.
pub fn seconds(seconds: f64) -> String {
    if seconds < 9.95 {
        format!("{seconds:.1} s")
    } else if seconds < 99.5 {
        format!("{seconds:.0} s")
    } else if seconds < 5970.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.0} h", seconds / 3600.0)
    }
}

/// A number of something.
pub fn count(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The text of a value, or a dash where there is none.
pub fn or_dash<T>(value: Option<T>, text: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_a_few_digits_and_a_unit() {
        assert_eq!(bytes(0), "0 kB");
        assert_eq!(bytes(999_499), "999 kB");
        assert_eq!(bytes(999_500), "1.0 MB");
        assert_eq!(bytes(12_345_678), "12.3 MB");
        assert_eq!(bytes(25_000_000_000), "25.00 GB");
        assert_eq!(seconds(0.04), "0.0 s");
        assert_eq!(seconds(9.94), "9.9 s");
        assert_eq!(seconds(9.96), "10 s");
        assert_eq!(seconds(99.0), "99 s");
        assert_eq!(seconds(100.0), "2 min");
        assert_eq!(seconds(7200.0), "2 h");
        assert_eq!(count(1, "part", "parts"), "1 part");
        assert_eq!(count(0, "part", "parts"), "0 parts");
        assert_eq!(or_dash(None, |n: u64| n.to_string()), "-");
    }
}

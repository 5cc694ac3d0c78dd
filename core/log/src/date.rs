//! Names of logs and their folders: the date that the clock reads.

/// UTC to the second, such as `2026-11-24T13-05-10Z`: sorts by time, and every file system takes
/// it.
pub fn name_of_date(now_ns: i64) -> String {
    let seconds = now_ns.div_euclid(1_000_000_000);
    let (days, second) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    let (year, month, day) = date(days);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}-{minute:02}-{second:02}Z")
}

/// Whether a file's name begins as [`name_of_date`] gives it.
pub fn is_date(name: &str) -> bool {
    const SHAPE: &[u8] = b"0000-00-00T00-00-00Z";
    let fits = |(shape, found): (&u8, u8)| match shape {
        b'0' => found.is_ascii_digit(),
        other => found == *other,
    };
    name.len() >= SHAPE.len() && SHAPE.iter().zip(name.bytes()).all(fits)
}

/// Year, month and day of a number of days since 1970. Years begin in March here, so that the leap
/// day is the last.
fn date(days: i64) -> (i64, i64, i64) {
    const ERA: i64 = 146_097;
    let days = days + 719_468;
    let (era, day) = (days.div_euclid(ERA), days.rem_euclid(ERA));
    let year = (day - day / 1460 + day / 36_524 - day / (ERA - 1)) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year + 400 * era + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_without_a_date_is_none() {
        for name in [
            "",
            "demo.mcap",
            "2026-11-24.mcap",
            "2026-11-24T13-05-1xZ.mcap",
        ] {
            assert!(!is_date(name), "{name}");
        }
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, name) in [
            (0, "1970-01-01T00-00-00Z"),
            (951_782_400, "2000-02-29T00-00-00Z"),
            (1_795_525_510, "2026-11-24T13-05-10Z"),
            (4_107_542_399, "2100-02-28T23-59-59Z"),
            (4_107_542_400, "2100-03-01T00-00-00Z"),
            (-1, "1969-12-31T23-59-59Z"),
        ] {
            assert_eq!(name_of_date(seconds * 1_000_000_000), name);
            assert!(is_date(&format!("{name}-1.mcap")));
        }
    }
}

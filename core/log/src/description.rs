//! A topic's layout as text: the schema that a log carries, for readers that are not this program.

use randt_messages::{Layout, Topic, layout::Fields};
use std::fmt::Write as _;

/// The layout of a topic's messages, little-endian, one line a field: offset, size, name, type.
///
/// Each struct comes once, after those inside it.
///
/// ```
/// let text = randt_log::describe::<randt_messages::RadarScan>();
/// assert!(text.contains("struct Return, 12 bytes\n  0 4 range_m f32\n"));
/// ```
pub fn describe<T: Topic>() -> String {
    let item = size_of::<T::Item>();
    let mut text = format!("{} {}\nlittle-endian, no padding\n", T::NAME, T::TYPE_NAME);
    let _ = writeln!(text, "message: {}", T::Head::NAME);
    if item > 0 {
        let _ = writeln!(
            text,
            "then: {} until its end, at most {}",
            T::Item::NAME,
            T::MAX_ITEMS
        );
    }
    let mut seen = Vec::new();
    let mut visit = |name: &'static str, size: usize, fields: Fields| {
        if seen.contains(&name) {
            return;
        }
        seen.push(name);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "struct {name}, {size} bytes");
        let ends = fields.iter().skip(1).map(|field| field.2).chain([size]);
        for ((field, kind, offset), end) in fields.iter().zip(ends) {
            let _ = writeln!(
                text,
                "  {offset} {} {field} {kind}",
                end.saturating_sub(*offset)
            );
        }
    };
    T::Head::visit(&mut visit);
    T::Item::visit(&mut visit);
    text
}

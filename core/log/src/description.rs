//! A topic's layout as text: the schema that a log carries, for readers that are not this program.

use randt_messages::{Layout, Topic, layout::Fields};
use std::fmt::Write as _;

/// What a line of codes begins with. Builds that do not know such lines pass over them.
pub(crate) const CODES: &str = "codes ";

/// The layout of a topic's messages, little-endian, one line per field: offset, size, name, type.
///
/// Each struct comes once, after those inside it. A field that holds the codes of an enum is
/// followed by a line of their names: `codes trust: 0 lost, 1 degraded, 2 good`.
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
        let (name, most) = (T::Item::NAME, T::MAX_ITEMS);
        let _ = writeln!(text, "then: {name} until its end, at most {most}");
    }
    let mut seen = Vec::new();
    let mut visit = |name: &'static str, size: usize, fields: Fields| {
        if seen.contains(&name) {
            return;
        }
        seen.push(name);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "struct {name}, {size} bytes");
        let begins = fields.iter().map(|field| field.offset);
        let ends = begins.skip(1).chain([size]);
        for (field, end) in fields.iter().zip(ends) {
            let (offset, name) = (field.offset, field.name);
            let size = end.saturating_sub(offset);
            let _ = writeln!(text, "  {offset} {size} {name} {}", field.kind);
            if !field.codes.is_empty() {
                let shown = |(code, name): &(u32, &str)| format!("{code} {name}");
                let codes: Vec<String> = field.codes.iter().map(shown).collect();
                let _ = writeln!(text, "{CODES}{name}: {}", codes.join(", "));
            }
        }
    };
    T::Head::visit(&mut visit);
    T::Item::visit(&mut visit);
    text
}

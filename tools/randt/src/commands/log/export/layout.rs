//! Messages of any build as columns of numbers: by the description that the log itself carries.

use anyhow::Context;
use randt_log::{Kind, Number, StoredLayout};

/// An array of more numbers than this is no column of a table.
const ARRAY_MAX: usize = 16;

/// One number, or a text, in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    offset: usize,
    cell: Cell,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    Number(Number),
    /// So many bytes, filled with zeros.
    Text(usize),
}

/// What a topic's messages hold.
#[derive(Debug, Default)]
pub struct Layout {
    pub head: Vec<Column>,
    pub head_bytes: usize,
    pub item: Vec<Column>,
    pub item_bytes: usize,
}

impl Layout {
    /// Of a description as `randt_log::describe` writes it.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let stored = StoredLayout::parse(text).context("no description of its messages")?;
        let mut layout = Self {
            head_bytes: stored.head.size(),
            item_bytes: stored.item.as_ref().map_or(0, Kind::size),
            ..Self::default()
        };
        add(&stored.head, String::new(), 0, &mut layout.head);
        if let Some(item) = &stored.item {
            let name = match item {
                Kind::Struct(_) => "",
                _ => "value",
            };
            add(item, name.to_owned(), 0, &mut layout.item);
        }
        Ok(layout)
    }
}

/// Adds the columns of a value that begins at an offset.
fn add(kind: &Kind, name: String, offset: usize, columns: &mut Vec<Column>) {
    let mut column = |name, offset, cell| columns.push(Column { name, offset, cell });
    match kind {
        Kind::Number(number) => column(name, offset, Cell::Number(*number)),
        Kind::Struct(inner) => {
            for field in &inner.fields {
                // The header's own names stand alone.
                let name = match name.as_str() {
                    "" | "header" => field.name.clone(),
                    outer => format!("{outer}.{}", field.name),
                };
                add(&field.kind, name, offset + field.offset, columns);
            }
        }
        Kind::Array(element, count) => match **element {
            Kind::Number(Number::U8) => column(name, offset, Cell::Text(*count)),
            Kind::Number(number) if *count <= ARRAY_MAX => {
                for i in 0..*count {
                    let offset = offset + i * number.size();
                    column(format!("{name}.{i}"), offset, Cell::Number(number));
                }
            }
            _ => {}
        },
    }
}

impl Cell {
    fn size(self) -> usize {
        match self {
            Self::Number(number) => number.size(),
            Self::Text(count) => count,
        }
    }
}

impl Column {
    /// The value in a head's or item's bytes, as it reads back; empty where the bytes end before it.
    pub fn text(&self, bytes: &[u8]) -> String {
        let field = bytes.get(self.offset..self.offset + self.cell.size());
        let text = field.and_then(|field| match self.cell {
            Cell::Number(number) => number.text(field),
            Cell::Text(_) => Some(quoted(randt_messages::health::text_of(field))),
        });
        text.unwrap_or_default()
    }
}

/// As CSV has text (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_log::describe;
    use randt_messages::{ImuSampleTopic, Message, RadarScan, Return, StageHealthTopic};

    #[test]
    fn every_number_of_a_message_has_its_column() {
        let layout = Layout::parse(&describe::<ImuSampleTopic>()).unwrap();
        let names: Vec<_> = layout.head.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "sequence",
                "stamp_ns",
                "epoch",
                "published_ns",
                "device_ns",
                "arrival_ns",
                "rate_rad_s.0",
                "rate_rad_s.1",
                "rate_rad_s.2",
                "acceleration_m_s2.0",
                "acceleration_m_s2.1",
                "acceleration_m_s2.2",
            ]
        );
        let mut sample = Message::<ImuSampleTopic>::default();
        sample.head.rate_rad_s[2] = 0.1;
        let mut bytes = Vec::new();
        sample.as_ref().write_bytes(&mut bytes);
        assert_eq!(layout.head[8].text(&bytes), "0.1");
        assert_eq!(layout.head[8].text(&bytes[..70]), "");
    }

    #[test]
    fn items_and_texts_have_theirs() {
        let layout = Layout::parse(&describe::<RadarScan>()).unwrap();
        assert_eq!(layout.item_bytes, size_of::<Return>());
        assert_eq!(layout.item[1].name, "intensity");
        assert!(layout.head.iter().any(|c| c.name == "sweep.beam_count"));
        let layout = Layout::parse(&describe::<StageHealthTopic>()).unwrap();
        let mut health = Message::<StageHealthTopic>::default();
        health.head.name = randt_messages::health::fixed_text("a,\"b");
        let mut bytes = Vec::new();
        health.as_ref().write_bytes(&mut bytes);
        let name = layout.head.iter().find(|c| c.name == "name").unwrap();
        assert_eq!(name.text(&bytes), "\"a,\"\"b\"");
        assert!(Layout::parse("anything").is_err());
    }
}

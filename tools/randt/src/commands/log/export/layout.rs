//! Messages of any build as columns of numbers: by the description that the log itself carries.

use randt_log::{Field, Kind, Number, StoredLayout};

/// An array of more numbers than this is no column of a table.
const ARRAY_MAX: usize = 16;

/// One number, or a text, in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    offset: usize,
    cell: Cell,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Cell {
    Number(Number),
    /// A code, shown as its name where the log has one.
    Code(Field),
    /// This number of bytes, filled with zeros.
    Text(usize),
}

/// What a topic's messages hold.
#[derive(Debug, Default)]
pub struct Layout {
    pub head: Vec<Column>,
    pub item: Vec<Column>,
    pub item_bytes: usize,
}

impl Layout {
    /// Of a layout that a log carries.
    pub fn from_stored(stored: &StoredLayout) -> Self {
        let mut layout = Self {
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
        layout
    }
}

/// Adds the columns of a value that begins at an offset.
fn add(kind: &Kind, name: String, offset: usize, columns: &mut Vec<Column>) {
    match kind {
        Kind::Number(number) => {
            let cell = Cell::Number(*number);
            columns.push(Column { name, offset, cell });
        }
        Kind::Struct(inner) => {
            for field in &inner.fields {
                // The header's own names stand alone.
                let name = match name.as_str() {
                    "" | "header" => field.name.clone(),
                    outer => format!("{outer}.{}", field.name),
                };
                let offset = offset + field.offset;
                if field.codes.is_empty() {
                    add(&field.kind, name, offset, columns);
                } else {
                    let cell = Cell::Code(field.clone());
                    columns.push(Column { name, offset, cell });
                }
            }
        }
        Kind::Array(element, count) => match **element {
            Kind::Number(Number::U8) => {
                let cell = Cell::Text(*count);
                columns.push(Column { name, offset, cell });
            }
            Kind::Number(number) if *count <= ARRAY_MAX => {
                columns.extend((0..*count).map(|i| Column {
                    name: format!("{name}.{i}"),
                    offset: offset + i * number.size(),
                    cell: Cell::Number(number),
                }));
            }
            _ => {}
        },
    }
}

impl Cell {
    fn size(&self) -> usize {
        match self {
            Self::Number(number) => number.size(),
            Self::Code(field) => field.kind.size(),
            Self::Text(count) => *count,
        }
    }
}

impl Column {
    /// The value in a head's or item's bytes, as it reads back; empty where the bytes end before
    /// it.
    pub fn text(&self, bytes: &[u8]) -> String {
        let field = bytes.get(self.offset..self.offset + self.cell.size());
        let text = field.and_then(|field| match &self.cell {
            Cell::Number(number) => number.text(field),
            Cell::Code(code) => {
                let number = u32::from_le_bytes(*field.first_chunk()?);
                let name = code.code_name(number).map(str::to_owned);
                Some(name.unwrap_or_else(|| number.to_string()))
            }
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
    use randt_messages::{
        ImuSampleTopic, Message, OdometryStateTopic, RadarScan, Return, StageHealthTopic, Topic,
        Trust,
    };

    fn layout_of<T: Topic>() -> Layout {
        Layout::from_stored(&StoredLayout::parse(&describe::<T>()).unwrap())
    }

    #[test]
    fn every_number_of_a_message_has_its_column() {
        let layout = layout_of::<ImuSampleTopic>();
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
        let layout = layout_of::<RadarScan>();
        assert_eq!(layout.item_bytes, size_of::<Return>());
        assert_eq!(layout.item[1].name, "intensity");
        assert!(layout.head.iter().any(|c| c.name == "sweep.beam_count"));
        let layout = layout_of::<StageHealthTopic>();
        let mut health = Message::<StageHealthTopic>::default();
        health.head.name = randt_messages::health::fixed_text("a,\"b");
        let mut bytes = Vec::new();
        health.as_ref().write_bytes(&mut bytes);
        let name = layout.head.iter().find(|c| c.name == "name").unwrap();
        assert_eq!(name.text(&bytes), "\"a,\"\"b\"");
    }

    #[test]
    fn codes_are_shown_by_their_names_where_the_log_has_them() {
        let text = describe::<OdometryStateTopic>();
        let mut state = Message::<OdometryStateTopic>::default();
        (state.head.trust, state.head.imu_use) = (Trust::Good as u32, 9);
        let mut bytes = Vec::new();
        state.as_ref().write_bytes(&mut bytes);
        let shown = |text: &str| {
            let layout = Layout::from_stored(&StoredLayout::parse(text).unwrap());
            let column = |name: &str| layout.head.iter().find(|c| c.name == name).unwrap();
            ["trust", "imu_use"].map(|name| column(name).text(&bytes))
        };
        assert_eq!(shown(&text), ["good", "9"]);
        let lines = text
            .lines()
            .filter(|line| line.starts_with('=') || !line.contains('='));
        let before = lines.collect::<Vec<_>>().join("\n");
        assert_eq!(shown(&before), ["2", "9"]);
    }
}

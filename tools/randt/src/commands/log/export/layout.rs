//! Messages of any build as columns of numbers: by the description that the log itself carries.

use anyhow::{Context, bail};
use std::collections::BTreeMap;

/// An array of more numbers than this is no column of a table.
const ARRAY_MAX: usize = 16;

/// One number, or a text, in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    offset: usize,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    U8,
    U16,
    U32,
    U64,
    I16,
    I32,
    I64,
    F32,
    F64,
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

struct Struct {
    size: usize,
    fields: Vec<(usize, usize, String, String)>,
}

impl Layout {
    /// Reads a description as `randt_log::describe` writes it.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let mut structs: BTreeMap<&str, Struct> = BTreeMap::new();
        let (mut head, mut item, mut last) = (None, None, "");
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("message: ") {
                head = Some(name);
            } else if let Some(rest) = line.strip_prefix("then: ") {
                item = rest.split_once(" until").map(|(name, _)| name);
            } else if let Some(rest) = line.strip_prefix("struct ") {
                let (name, size) = rest.split_once(", ").context("a struct without a size")?;
                let size = size.trim_end_matches(" bytes").parse()?;
                let fields = Vec::new();
                structs.insert(name, Struct { size, fields });
                last = name;
            } else if let Some(field) = line.strip_prefix("  ") {
                let mut words = field.splitn(4, ' ');
                let mut word = || words.next().context("a field of less than four words");
                let (offset, size) = (word()?.parse()?, word()?.parse()?);
                let (name, kind) = (word()?.to_owned(), word()?.to_owned());
                let fields = structs.get_mut(last).map(|found| &mut found.fields);
                let fields = fields.context("a field outside of a struct")?;
                fields.push((offset, size, name, kind));
            }
        }
        let mut layout = Self::default();
        let Some(found) = head.and_then(|head| structs.get(head)) else {
            bail!("no description of its messages");
        };
        layout.head_bytes = found.size;
        flatten(found, &structs, "", 0, &mut layout.head);
        if let Some(found) = item.and_then(|item| structs.get(item)) {
            layout.item_bytes = found.size;
            flatten(found, &structs, "", 0, &mut layout.item);
        } else if let Some(kind) = item.and_then(primitive) {
            layout.item_bytes = kind.size();
            let name = "value".to_owned();
            let offset = 0;
            layout.item.push(Column { name, offset, kind });
        }
        Ok(layout)
    }
}

fn flatten(
    from: &Struct,
    structs: &BTreeMap<&str, Struct>,
    prefix: &str,
    begin: usize,
    columns: &mut Vec<Column>,
) {
    for (offset, size, name, kind) in &from.fields {
        let offset = begin + offset;
        // The header's own names stand alone.
        let name = match prefix {
            "" | "header" => name.clone(),
            prefix => format!("{prefix}.{name}"),
        };
        if let Some(kind) = primitive(kind) {
            columns.push(Column { name, offset, kind });
        } else if let Some(inner) = structs.get(kind.as_str()) {
            flatten(inner, structs, &name, offset, columns);
        } else if let Some((element, _)) = kind.trim_start_matches('[').split_once(';')
            && let Some(kind) = primitive(element)
        {
            let count = size / kind.size();
            if kind == Kind::U8 {
                let kind = Kind::Text(count);
                columns.push(Column { name, offset, kind });
            } else if count <= ARRAY_MAX {
                columns.extend((0..count).map(|i| Column {
                    name: format!("{name}.{i}"),
                    offset: offset + i * kind.size(),
                    kind,
                }));
            }
        }
    }
}

fn primitive(name: &str) -> Option<Kind> {
    Some(match name {
        "u8" => Kind::U8,
        "u16" => Kind::U16,
        "u32" => Kind::U32,
        "u64" => Kind::U64,
        "i16" => Kind::I16,
        "i32" => Kind::I32,
        "i64" => Kind::I64,
        "f32" => Kind::F32,
        "f64" => Kind::F64,
        _ => return None,
    })
}

impl Kind {
    fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Text(count) => count,
        }
    }
}

impl Column {
    /// The value in a head's or item's bytes, as it reads back; empty where the bytes end before it.
    pub fn text(&self, bytes: &[u8]) -> String {
        let field = bytes.get(self.offset..self.offset + self.kind.size());
        field
            .and_then(|field| self.value(field))
            .unwrap_or_default()
    }

    fn value(&self, field: &[u8]) -> Option<String> {
        Some(match self.kind {
            Kind::U8 => field.first()?.to_string(),
            Kind::U16 => u16::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::U32 => u32::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::U64 => u64::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::I16 => i16::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::I32 => i32::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::I64 => i64::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::F32 => f32::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::F64 => f64::from_le_bytes(*field.first_chunk()?).to_string(),
            Kind::Text(_) => quoted(randt_messages::health::text_of(field)),
        })
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

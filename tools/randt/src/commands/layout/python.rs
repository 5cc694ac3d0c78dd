//! The bus as a Python module: numpy types made from the layout, and the class that reads.

use super::bus_layout::{BusLayout, TopicLayout};
use randt_log::{Kind, Number, Struct};
use std::fmt::Write as _;

/// What does not depend on the layout.
const READER: &str = include_str!("bus.py");

/// The module's text.
pub fn module(layout: &BusLayout) -> String {
    let mut out = READER.to_owned();
    let _ = writeln!(out, "\n\n# Layouts of randt {}.", env!("CARGO_PKG_VERSION"));
    for found in &layout.structs {
        write_type(&mut out, found);
    }
    out.push_str("\n# What the numbers of a field stand for.\nCODES = {\n");
    for found in &layout.structs {
        write_codes(&mut out, found);
    }
    out.push_str("}\n\nTOPICS = {\n");
    for topic in &layout.topics {
        write_topic(&mut out, topic);
    }
    out.push_str("}\n");
    out
}

fn write_type(out: &mut String, found: &Struct) {
    // Writing to a String cannot fail.
    let _ = writeln!(out, "{} = np.dtype(\n    {{", found.name);
    let names = found
        .fields
        .iter()
        .map(|field| format!("\"{}\"", field.name));
    let formats = found.fields.iter().map(|field| format(&field.kind));
    let offsets = found.fields.iter().map(|field| field.offset.to_string());
    write_list(out, "names", names.collect());
    write_list(out, "formats", formats.collect());
    write_list(out, "offsets", offsets.collect());
    let _ = writeln!(out, "        \"itemsize\": {},\n    }}\n)", found.size);
}

fn write_list(out: &mut String, key: &str, values: Vec<String>) {
    let _ = writeln!(out, "        \"{key}\": [{}],", values.join(", "));
}

fn write_codes(out: &mut String, found: &Struct) {
    for field in found.fields.iter().filter(|field| !field.codes.is_empty()) {
        let codes = field.codes.iter();
        let codes: Vec<_> = codes
            .map(|(code, name)| format!("{code}: \"{name}\""))
            .collect();
        let (name, codes) = (&field.name, codes.join(", "));
        let _ = writeln!(out, "    \"{}.{name}\": {{{codes}}},", found.name);
    }
}

fn write_topic(out: &mut String, topic: &TopicLayout) {
    let bus = &topic.topic;
    let item = topic.item.as_ref().map_or("None".to_owned(), format);
    let (name, type_name, head) = (bus.name, bus.type_name, &topic.head.name);
    let _ = writeln!(
        out,
        "    \"{name}\": Topic(\"{type_name}\", {head}, {item}),"
    );
}

/// A format of numpy. Bytes in a struct are text.
fn format(kind: &Kind) -> String {
    match kind {
        Kind::Number(number) => format!("\"{}\"", number_name(*number)),
        Kind::Array(element, count) if **element == Kind::Number(Number::U8) => {
            format!("\"S{count}\"")
        }
        Kind::Array(element, count) => format!("({}, ({count},))", format(element)),
        Kind::Struct(found) => found.name.clone(),
    }
}

fn number_name(number: Number) -> &'static str {
    match number {
        Number::U8 => "u1",
        Number::U16 => "<u2",
        Number::U32 => "<u4",
        Number::U64 => "<u8",
        Number::I8 => "i1",
        Number::I16 => "<i2",
        Number::I32 => "<i4",
        Number::I64 => "<i8",
        Number::F32 => "<f4",
        Number::F64 => "<f8",
    }
}

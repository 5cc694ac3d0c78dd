//! The bus as a Rust module that depends on nothing.

use super::bus_layout::{BusLayout, TopicLayout};
use randt_log::{Kind, Number, Struct};
use std::fmt::Write as _;

/// The module's text.
pub fn module(layout: &BusLayout) -> String {
    let mut out = format!(
        "//! The messages on randt's bus, little-endian and without padding, as randt {} has them.\n\
         //!\n\
         //! Printed by `randt layout --rust`. A type's name has a hash of its layout: print this\n\
         //! module anew for another build. In this workspace take `randt_messages` instead.\n\n\
         use core::mem::{{offset_of, size_of}};\n",
        env!("CARGO_PKG_VERSION"),
    );
    for found in &layout.structs {
        write_struct(&mut out, found);
    }
    for topic in &layout.topics {
        write_topic(&mut out, topic);
    }
    out
}

fn write_struct(out: &mut String, found: &Struct) {
    let own = &found.name;
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n/// {} bytes.", found.size);
    let _ = writeln!(
        out,
        "#[repr(C)]\n#[derive(Clone, Copy, Debug)]\npub struct {own} {{"
    );
    for field in &found.fields {
        let codes = field.codes.iter();
        let codes: Vec<_> = codes.map(|(code, name)| format!("{code} {name}")).collect();
        if !codes.is_empty() {
            let _ = writeln!(out, "    /// {}.", codes.join(", "));
        }
        let _ = writeln!(out, "    pub {}: {},", field.name, name(&field.kind));
    }
    let _ = writeln!(
        out,
        "}}\nconst _: () = assert!(size_of::<{own}>() == {});",
        found.size
    );
    for field in &found.fields {
        let (name, offset) = (&field.name, field.offset);
        let _ = writeln!(
            out,
            "const _: () = assert!(offset_of!({own}, {name}) == {offset});"
        );
    }
}

fn write_topic(out: &mut String, topic: &TopicLayout) {
    let (constant, bus) = (topic.constant(), &topic.topic);
    let item = topic.item.as_ref().map_or("()".to_owned(), name);
    let head = &topic.head.name;
    let _ = writeln!(out, "\n/// A [`{head}`], then any number of `{item}`.");
    let _ = writeln!(out, "pub const {constant}_TOPIC: &str = \"{}\";", bus.name);
    let _ = writeln!(out, "/// Its messages' type name on the bus.");
    let _ = writeln!(
        out,
        "pub const {constant}_TYPE: &str = \"{}\";",
        bus.type_name
    );
}

fn name(kind: &Kind) -> String {
    match kind {
        Kind::Number(number) => number_name(*number).to_owned(),
        Kind::Array(element, count) => format!("[{}; {count}]", name(element)),
        Kind::Struct(found) => found.name.clone(),
    }
}

fn number_name(number: Number) -> &'static str {
    match number {
        Number::U8 => "u8",
        Number::U16 => "u16",
        Number::U32 => "u32",
        Number::U64 => "u64",
        Number::I8 => "i8",
        Number::I16 => "i16",
        Number::I32 => "i32",
        Number::I64 => "i64",
        Number::F32 => "f32",
        Number::F64 => "f64",
    }
}

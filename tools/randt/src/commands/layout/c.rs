//! The bus as a C header.

use super::bus_layout::{BusLayout, snake_case};
use randt_log::{Kind, Number, Struct};
use std::fmt::Write as _;

/// What `librandt_bus` has (tools/c).
const FUNCTIONS: &str = include_str!("functions.h");

/// The header's text.
pub fn header(layout: &BusLayout) -> String {
    let mut out = format!(
        "/* The messages on randt's bus, little-endian and without padding, as randt {} has them.\n   \
         Printed by `randt layout --c`. A type's name has a hash of its layout: print this header\n   \
         anew for another build. */\n\
         #ifndef RANDT_BUS_H\n#define RANDT_BUS_H\n\n\
         #include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n",
        env!("CARGO_PKG_VERSION"),
    );
    for found in &layout.structs {
        write_struct(&mut out, found);
    }
    for topic in &layout.topics {
        let (constant, bus) = (topic.constant(), &topic.topic);
        // Writing to a String cannot fail.
        let _ = writeln!(out, "\n#define RANDT_{constant}_TOPIC \"{}\"", bus.name);
        let _ = writeln!(out, "#define RANDT_{constant}_TYPE \"{}\"", bus.type_name);
        let head = snake_case(&topic.head.name);
        let _ = writeln!(out, "typedef struct randt_{head} RANDT_{constant}_HEAD;");
        if let Some(item) = &topic.item {
            let _ = writeln!(out, "typedef {} RANDT_{constant}_ITEM;", name(item));
        }
    }
    let _ = write!(out, "\n{FUNCTIONS}\n#endif\n");
    out
}

fn write_struct(out: &mut String, found: &Struct) {
    let own = format!("struct randt_{}", snake_case(&found.name));
    let _ = writeln!(out, "\n{own} {{");
    for field in &found.fields {
        let mut kind = &field.kind;
        let mut counts = String::new();
        while let Kind::Array(element, count) = kind {
            let _ = write!(counts, "[{count}]");
            kind = element;
        }
        let _ = writeln!(out, "    {} {}{counts};", name(kind), field.name);
    }
    let _ = writeln!(
        out,
        "}};\nstatic_assert(sizeof({own}) == {}, \"\");",
        found.size
    );
    for field in &found.fields {
        let (name, offset) = (&field.name, field.offset);
        let _ = writeln!(
            out,
            "static_assert(offsetof({own}, {name}) == {offset}, \"\");"
        );
        let prefix = format!("RANDT_{}_{name}", snake_case(&found.name)).to_uppercase();
        for (code, meaning) in &field.codes {
            let meaning = meaning.to_uppercase().replace(['-', ' '], "_");
            let _ = writeln!(out, "#define {prefix}_{meaning} {code}u");
        }
    }
}

/// A kind that is no array. Arrays of items are not on the bus.
fn name(kind: &Kind) -> String {
    match kind {
        Kind::Number(number) => number_name(*number).to_owned(),
        Kind::Array(element, _) => name(element),
        Kind::Struct(found) => format!("struct randt_{}", snake_case(&found.name)),
    }
}

fn number_name(number: Number) -> &'static str {
    match number {
        Number::U8 => "uint8_t",
        Number::U16 => "uint16_t",
        Number::U32 => "uint32_t",
        Number::U64 => "uint64_t",
        Number::I8 => "int8_t",
        Number::I16 => "int16_t",
        Number::I32 => "int32_t",
        Number::I64 => "int64_t",
        Number::F32 => "float",
        Number::F64 => "double",
    }
}

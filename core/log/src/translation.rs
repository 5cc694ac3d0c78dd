//! Messages of another build's layout as those of this one: field by field, by their names.

use crate::stored_layout::{Kind, Number, StoredLayout, Struct};
use std::cmp::Ordering;

/// How the bytes of one layout become those of another one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Translation {
    head: Part,
    item: Part,
    /// Fields that the stored layout lacks, or has as something that these are not: they are 0.
    pub lacking: Vec<String>,
    /// Fields that it has beside ours: they are not read.
    pub unread: Vec<String>,
}

/// The fixed part, or one item.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Part {
    from: usize,
    to: usize,
    steps: Vec<Step>,
}

/// Bytes that are taken as they are, or a number that gets another size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Step {
    from: usize,
    to: usize,
    how: How,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    Copy(usize),
    Widen(Number, Number),
}

impl Translation {
    /// From one layout to another.
    pub fn between(from: &StoredLayout, to: &StoredLayout) -> Self {
        let mut translation = Self::default();
        translation.head = translation.part(&from.head, &to.head);
        if let (Some(from), Some(to)) = (&from.item, &to.item) {
            translation.item = translation.part(from, to);
        } else {
            // Items that nobody reads are passed over.
            translation.item.from = from.item.as_ref().map_or(0, Kind::size);
        }
        translation
    }

    fn part(&mut self, from: &Kind, to: &Kind) -> Part {
        let mut steps = Vec::new();
        self.value("", (from, 0), (to, 0), &mut steps);
        Part {
            from: from.size(),
            to: to.size(),
            steps,
        }
    }

    /// The steps for one value, which begins at these offsets.
    fn value(
        &mut self,
        name: &str,
        (from, from_at): (&Kind, usize),
        (to, to_at): (&Kind, usize),
        steps: &mut Vec<Step>,
    ) {
        match (from, to) {
            _ if from == to => push(steps, from_at, to_at, How::Copy(to.size())),
            (Kind::Number(from), Kind::Number(to)) if is_wider(*from, *to) => {
                push(steps, from_at, to_at, How::Widen(*from, *to));
            }
            (Kind::Struct(from), Kind::Struct(to)) => {
                self.fields(name, (from, from_at), (to, to_at), steps);
            }
            (Kind::Array(from, from_count), Kind::Array(to, to_count)) => {
                // What is longer is cut, what is shorter ends with zeros.
                let beyond = format!("{name}[{}..]", from_count.min(to_count));
                match from_count.cmp(to_count) {
                    Ordering::Less => note(&mut self.lacking, &beyond),
                    Ordering::Greater => note(&mut self.unread, &beyond),
                    Ordering::Equal => {}
                }
                for i in 0..*from_count.min(to_count) {
                    let (from_at, to_at) = (from_at + i * from.size(), to_at + i * to.size());
                    self.value(name, (from, from_at), (to, to_at), steps);
                }
            }
            _ => note(&mut self.lacking, name),
        }
    }

    fn fields(
        &mut self,
        name: &str,
        (from, from_at): (&Struct, usize),
        (to, to_at): (&Struct, usize),
        steps: &mut Vec<Step>,
    ) {
        let of = |field: &str| match name {
            "" => field.to_owned(),
            outer => format!("{outer}.{field}"),
        };
        for field in &to.fields {
            let name = of(&field.name);
            match from.fields.iter().find(|found| found.name == field.name) {
                Some(found) => self.value(
                    &name,
                    (&found.kind, from_at + found.offset),
                    (&field.kind, to_at + field.offset),
                    steps,
                ),
                None => note(&mut self.lacking, &name),
            }
        }
        for field in &from.fields {
            if to.fields.iter().all(|known| known.name != field.name) {
                note(&mut self.unread, &of(&field.name));
            }
        }
    }

    /// A message's bytes in this program's layout; `None` where their number does not fit the stored one.
    pub fn apply(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let (head, items) = bytes.split_at_checked(self.head.from)?;
        let mut out = Vec::new();
        self.head.apply(head, &mut out)?;
        if self.item.from > 0 {
            let items = items.chunks_exact(self.item.from);
            if !items.remainder().is_empty() {
                return None;
            }
            for item in items {
                self.item.apply(item, &mut out)?;
            }
        }
        Some(out)
    }
}

impl Part {
    fn apply(&self, bytes: &[u8], out: &mut Vec<u8>) -> Option<()> {
        let begin = out.len();
        out.resize(begin + self.to, 0);
        let out = out.get_mut(begin..)?;
        for step in &self.steps {
            let from = bytes.get(step.from..)?;
            let to = out.get_mut(step.to..)?;
            match step.how {
                How::Copy(count) => to.get_mut(..count)?.copy_from_slice(from.get(..count)?),
                How::Widen(narrow, wide) => {
                    let value = read(narrow, from)?;
                    write(wide, value, to)?;
                }
            }
        }
        Some(())
    }
}

/// Adds a step; one that goes on where the last one ended becomes part of it.
fn push(steps: &mut Vec<Step>, from: usize, to: usize, how: How) {
    if let (Some(last), How::Copy(more)) = (steps.last_mut(), how)
        && let How::Copy(count) = last.how
        && (last.from + count, last.to + count) == (from, to)
    {
        last.how = How::Copy(count + more);
        return;
    }
    steps.push(Step { from, to, how });
}

/// Each name once, in the order of their appearance.
fn note(names: &mut Vec<String>, name: &str) {
    if !names.iter().any(|known| known == name) {
        names.push(name.to_owned());
    }
}

/// A number on its way from one size to another.
#[derive(Clone, Copy)]
enum Value {
    Whole(i128),
    Real(f64),
}

/// Whether every value of the one is a value of the other.
fn is_wider(from: Number, to: Number) -> bool {
    let is_real = |number| matches!(number, Number::F32 | Number::F64);
    let is_signed = |number| matches!(number, Number::I8 | Number::I16 | Number::I32 | Number::I64);
    match (is_real(from), is_real(to)) {
        (true, true) => to.size() >= from.size(),
        (false, false) if is_signed(from) == is_signed(to) => to.size() >= from.size(),
        (false, false) => is_signed(to) && to.size() > from.size(),
        _ => false,
    }
}

fn read(number: Number, bytes: &[u8]) -> Option<Value> {
    Some(match number {
        Number::U8 => Value::Whole((*bytes.first()?).into()),
        Number::U16 => Value::Whole(u16::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::U32 => Value::Whole(u32::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::U64 => Value::Whole(u64::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::I8 => Value::Whole(i8::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::I16 => Value::Whole(i16::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::I32 => Value::Whole(i32::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::I64 => Value::Whole(i64::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::F32 => Value::Real(f32::from_le_bytes(*bytes.first_chunk()?).into()),
        Number::F64 => Value::Real(f64::from_le_bytes(*bytes.first_chunk()?)),
    })
}

/// Writes a value where every one fits ([`is_wider`]).
fn write(number: Number, value: Value, out: &mut [u8]) -> Option<()> {
    let bytes = match value {
        // A longer number's first bytes are those of a shorter one.
        Value::Whole(whole) => whole.to_le_bytes(),
        Value::Real(real) => i128::from(match number {
            Number::F32 => u64::from((real as f32).to_bits()),
            _ => real.to_bits(),
        })
        .to_le_bytes(),
    };
    let size = number.size();
    out.get_mut(..size)?.copy_from_slice(bytes.get(..size)?);
    Some(())
}

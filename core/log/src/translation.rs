//! Messages of another build's layout as those of this one: field by field, by their names.

use crate::describe;
use crate::stored_layout::{Field, Framing, Kind, Number, StoredLayout, Struct, Value};
use randt_messages::layout::{Fields, Former};
use randt_messages::{Layout, Topic};
use std::cmp::Ordering;

/// How the bytes of one layout become those of another one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Translation {
    framing: Framing,
    head: Conversion,
    item: Conversion,
    /// Fields that the stored layout lacks, or has as something that these are not: they are 0.
    pub lacking: Vec<String>,
    /// Fields that it has beside ours: they are not read.
    pub unread: Vec<String>,
}

/// The layout of this build, and where earlier builds had its fields.
pub(crate) struct OwnLayout {
    layout: StoredLayout,
    structs: Vec<(&'static str, Fields)>,
}

/// The fixed part, or one item.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Conversion {
    from: usize,
    to: usize,
    steps: Vec<Step>,
}

/// Where a value is read, where it is written, and what happens to it between.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Step {
    from: usize,
    to: usize,
    how: How,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum How {
    /// That many bytes are taken as they are.
    Copy(usize),
    /// A number gets another size.
    Widen(Number, Number),
    /// A code gets the number that its name has in this build.
    Recode(Vec<(u32, u32)>),
    /// A bit of a value that is converted already, at `from` in the output, becomes a value of its
    /// own.
    MoveBit(u32),
}

/// A value and where it begins.
type At<'a, T> = (&'a T, usize);

impl OwnLayout {
    /// That of a topic.
    pub fn from_topic<T: Topic>() -> Option<Self> {
        let mut structs = Vec::new();
        let mut visit = |name: &'static str, _: usize, fields: Fields| structs.push((name, fields));
        T::Head::visit(&mut visit);
        // A definition gives the message's own struct no name.
        if let Some((name, _)) = structs.last_mut() {
            *name = "";
        }
        let mut visit = |name: &'static str, _: usize, fields: Fields| structs.push((name, fields));
        T::Item::visit(&mut visit);
        let layout = StoredLayout::parse(&describe::<T>())?;
        Some(Self { layout, structs })
    }

    /// Where earlier builds had a field.
    fn former(&self, within: &Struct, field: &Field) -> &'static [Former] {
        let mut structs = self.structs.iter();
        let fields = structs.find(|(name, _)| *name == within.name);
        let known = fields.and_then(|(_, fields)| fields.iter().find(|own| own.name == field.name));
        known.map_or(&[], |known| known.former)
    }
}

impl Translation {
    /// From the layout that a log carries to that of this build.
    pub fn between(from: &StoredLayout, own: &OwnLayout) -> Self {
        let mut builder = Builder {
            own,
            translation: Self::default(),
        };
        let to = &own.layout;
        let head = builder.conversion(&from.head, &to.head);
        let item = match (&from.item, &to.item) {
            (Some(from), Some(to)) => builder.conversion(from, to),
            // Items that this build does not read are passed over.
            _ => Conversion {
                from: from.item.as_ref().map_or(0, Kind::size),
                ..Conversion::default()
            },
        };
        Self {
            framing: from.framing,
            head,
            item,
            ..builder.translation
        }
    }

    /// A message's bytes as the bus of this program has them; `None` where their number does not
    /// fit the stored one.
    pub fn apply(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let split = self.framing.split(bytes, self.head.from, self.item.from);
        let (head, items) = split?;
        let mut out = Vec::new();
        self.head.apply(head, &mut out)?;
        if self.item.from > 0 {
            for item in items.chunks_exact(self.item.from) {
                self.item.apply(item, &mut out)?;
            }
        }
        Some(out)
    }
}

/// A translation in the making.
struct Builder<'a> {
    own: &'a OwnLayout,
    translation: Translation,
}

impl Builder<'_> {
    fn conversion(&mut self, from: &Kind, to: &Kind) -> Conversion {
        let mut steps = Vec::new();
        self.value("", (from, 0), (to, 0), &mut steps);
        Conversion {
            from: from.size(),
            to: to.size(),
            steps,
        }
    }

    /// The steps for one value.
    fn value(
        &mut self,
        name: &str,
        (from, from_at): At<'_, Kind>,
        (to, to_at): At<'_, Kind>,
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
                    Ordering::Less => self.lacks(&beyond),
                    Ordering::Greater => add_once(&mut self.translation.unread, &beyond),
                    Ordering::Equal => {}
                }
                for i in 0..*from_count.min(to_count) {
                    let (from_at, to_at) = (from_at + i * from.size(), to_at + i * to.size());
                    self.value(name, (from, from_at), (to, to_at), steps);
                }
            }
            _ => self.lacks(name),
        }
    }

    fn fields(
        &mut self,
        name: &str,
        (from, from_at): At<'_, Struct>,
        (to, to_at): At<'_, Struct>,
        steps: &mut Vec<Step>,
    ) {
        let path = |field: &str| match name {
            "" => field.to_owned(),
            outer => format!("{outer}.{field}"),
        };
        let mut read = Vec::new();
        let mut bits = Vec::new();
        for field in &to.fields {
            let name = path(&field.name);
            let former = self.own.former(to, field);
            let (from_at, to_at) = (|found: &Field| from_at + found.offset, to_at + field.offset);
            if let Some(found) = stored(from, field, former) {
                read.push(&found.name);
                match recoding(found, field) {
                    Some(codes) => push(steps, from_at(found), to_at, How::Recode(codes)),
                    None => {
                        let stored = (&found.kind, from_at(found));
                        self.value(&name, stored, (&field.kind, to_at), steps);
                    }
                }
            } else if let Some((holder, bit)) = stored_bit(from, to, former) {
                bits.push((holder.offset, field.offset, bit));
            } else {
                self.lacks(&name);
            }
        }
        // Bits are moved when the fields that hold them are converted.
        for (holder, field, bit) in bits {
            push(steps, to_at + holder, to_at + field, How::MoveBit(bit));
        }
        let is_unread = |field: &&Field| !read.contains(&&field.name);
        for field in from.fields.iter().filter(is_unread) {
            add_once(&mut self.translation.unread, &path(&field.name));
        }
    }

    fn lacks(&mut self, name: &str) {
        add_once(&mut self.translation.lacking, name);
    }
}

/// The stored field that a field of this build is read from: of its name, else of a former one.
fn stored<'a>(from: &'a Struct, field: &Field, former: &[Former]) -> Option<&'a Field> {
    let named = |name: &str| from.fields.iter().find(|found| found.name == name);
    let former = former.iter().filter_map(|former| match former {
        Former::Name(name) => named(name),
        Former::Bit(..) => None,
    });
    named(&field.name).or({ former }.next())
}

/// The field that has kept a field of this build as one of its bits, and which one.
fn stored_bit<'a>(from: &Struct, to: &'a Struct, former: &[Former]) -> Option<(&'a Field, u32)> {
    former.iter().find_map(|former| {
        let Former::Bit(name, bit) = former else {
            return None;
        };
        let is_stored = from.fields.iter().any(|found| found.name == *name);
        let holder = to.fields.iter().find(|field| field.name == *name)?;
        let is_inside = (*bit as usize) < 8 * holder.kind.size();
        (is_stored && is_inside).then_some((holder, *bit))
    })
}

/// The codes of a field as this build has them; `None` where they are the same, or where the log
/// does not name them.
fn recoding(from: &Field, to: &Field) -> Option<Vec<(u32, u32)>> {
    let number = Kind::Number(Number::U32);
    if from.kind != number || to.kind != number {
        return None;
    }
    let is_used = |code: u32| to.code_name(code).is_some();
    let own = |(code, name): &(u32, String)| {
        let named = to.codes.iter().find(|(_, known)| known == name);
        match named {
            Some((own, _)) => (*code, *own),
            // No code of this build means it.
            None if is_used(*code) => (*code, u32::MAX),
            None => (*code, *code),
        }
    };
    let codes: Vec<(u32, u32)> = from.codes.iter().map(own).collect();
    codes.iter().any(|(from, to)| from != to).then_some(codes)
}

impl Conversion {
    fn apply(&self, bytes: &[u8], out: &mut Vec<u8>) -> Option<()> {
        let begin = out.len();
        out.resize(begin + self.to, 0);
        let out = out.get_mut(begin..)?;
        for step in &self.steps {
            if let How::MoveBit(bit) = step.how {
                let (byte, mask) = (bit as usize / 8, 1 << (bit % 8));
                let holder = out.get_mut(step.from + byte)?;
                let is_set = *holder & mask != 0;
                *holder &= !mask;
                *out.get_mut(step.to)? = u8::from(is_set);
                continue;
            }
            let from = bytes.get(step.from..)?;
            let to = out.get_mut(step.to..)?;
            match &step.how {
                How::Copy(count) => to.get_mut(..*count)?.copy_from_slice(from.get(..*count)?),
                How::Widen(narrow, wide) => write(*wide, narrow.read(from)?, to)?,
                How::Recode(codes) => {
                    let code = u32::from_le_bytes(*from.first_chunk()?);
                    let found = codes.iter().find(|(stored, _)| *stored == code);
                    let own = found.map_or(code, |(_, own)| *own);
                    *to.first_chunk_mut()? = own.to_le_bytes();
                }
                How::MoveBit(_) => {}
            }
        }
        Some(())
    }
}

/// Adds a step; one that goes on where the last one ended becomes part of it.
fn push(steps: &mut Vec<Step>, from: usize, to: usize, how: How) {
    if let (Some(last), How::Copy(more)) = (steps.last_mut(), &how)
        && let How::Copy(count) = &mut last.how
        && (last.from + *count, last.to + *count) == (from, to)
    {
        *count += more;
        return;
    }
    steps.push(Step { from, to, how });
}

/// Each name once, in the order of their appearance.
fn add_once(names: &mut Vec<String>, name: &str) {
    if !names.iter().any(|known| known == name) {
        names.push(name.to_owned());
    }
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

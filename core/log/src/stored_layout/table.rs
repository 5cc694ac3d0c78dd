//! A layout as a table of offsets, sizes, names and types, which logs carried up to 0.1.0.

use super::{Field, Framing, Kind, Number, StoredLayout, Struct};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a line of codes begins with: `codes trust: 0 lost, 1 degraded, 2 good`.
const CODES: &str = "codes ";

/// Reads one; `None` where it makes no sense.
pub(super) fn parse(text: &str) -> Option<StoredLayout> {
    let mut parser = Parser::default();
    text.lines().try_for_each(|line| parser.take(line))?;
    parser.layout()
}

/// What was read so far.
#[derive(Default)]
struct Parser<'a> {
    structs: BTreeMap<&'a str, Arc<Struct>>,
    /// The struct whose fields come.
    last: &'a str,
    head: &'a str,
    item: Option<&'a str>,
}

impl<'a> Parser<'a> {
    /// Reads a line; `None` where it makes no sense.
    fn take(&mut self, line: &'a str) -> Option<()> {
        if let Some(name) = line.strip_prefix("message: ") {
            self.head = name;
        } else if let Some(rest) = line.strip_prefix("then: ") {
            self.item = Some(rest.split_once(" until")?.0);
        } else if let Some(rest) = line.strip_prefix("struct ") {
            let (name, size) = rest.split_once(", ")?;
            let size = size.strip_suffix(" bytes")?.parse().ok()?;
            let new = Struct {
                name: name.to_owned(),
                fields: Vec::new(),
                size,
            };
            self.structs.insert(name, Arc::new(new));
            self.last = name;
        } else if let Some(codes) = line.strip_prefix(CODES) {
            let (name, codes) = codes.split_once(": ")?;
            let field = self.last_struct()?.fields.last_mut()?;
            (field.name == name).then_some(())?;
            for code in codes.split(", ") {
                let (code, name) = code.split_once(' ')?;
                field.codes.push((code.parse().ok()?, name.to_owned()));
            }
        } else if let Some(field) = line.strip_prefix("  ") {
            let mut words = field.splitn(4, ' ');
            let offset: usize = words.next()?.parse().ok()?;
            let size: usize = words.next()?.parse().ok()?;
            let (name, kind) = (words.next()?.to_owned(), words.next()?);
            let kind = self.kind(kind, size)?;
            let within = self.last_struct()?;
            let is_inside = kind.size() == size && offset.checked_add(size)? <= within.size;
            is_inside.then_some(())?;
            within.fields.push(Field {
                name,
                offset,
                kind,
                codes: Vec::new(),
            });
        }
        Some(())
    }

    /// The struct whose fields come. It is not shared before its last field is there.
    fn last_struct(&mut self) -> Option<&mut Struct> {
        Arc::get_mut(self.structs.get_mut(self.last)?)
    }

    /// A kind by its name; each struct comes after those inside it. The length of an array may be
    /// a constant's name, so it follows from the size.
    fn kind(&self, name: &str, size: usize) -> Option<Kind> {
        let name = name.trim();
        if let Some(array) = name.strip_prefix('[') {
            let (element, count) = array.strip_suffix(']')?.rsplit_once(';')?;
            let known: Option<usize> = count.trim().parse().ok();
            let element = self.kind(element, size.checked_div(known.unwrap_or(1))?)?;
            let count = size.checked_div(element.size())?;
            return Some(Kind::Array(Box::new(element), count));
        }
        if let Some(number) = Number::from_name(name) {
            return Some(Kind::Number(number));
        }
        let own = name.rsplit("::").next()?;
        self.structs.get(own).cloned().map(Kind::Struct)
    }

    fn layout(&self) -> Option<StoredLayout> {
        let head = Arc::clone(self.structs.get(self.head)?);
        let item = match self.item {
            Some(name) => Some(self.kind(name, 0)?),
            None => None,
        };
        Some(StoredLayout {
            head: Kind::Struct(head),
            item,
            framing: Framing::Bus,
        })
    }
}

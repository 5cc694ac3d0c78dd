//! The layout of a topic's messages as a log describes it: that of the build that wrote the log.

use crate::description::CODES;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a topic's messages hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredLayout {
    /// The fixed part.
    pub head: Kind,
    /// One element of what follows it, where something does.
    pub item: Option<Kind>,
}

/// How a value is stored, little-endian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Number(Number),
    /// That many values of one kind.
    Array(Box<Kind>, usize),
    /// Values by name. Shared: a description may use a struct any number of times.
    Struct(Arc<Struct>),
}

/// A struct's fields and size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Struct {
    /// Its name.
    pub name: String,
    /// In their order.
    pub fields: Vec<Field>,
    /// Bytes.
    pub size: usize,
}

/// A value of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Where it begins in the struct, bytes.
    pub offset: usize,
    /// How it is stored.
    pub kind: Kind,
    /// What its numbers stand for; empty where they are numbers, or where the log does not say.
    pub codes: Vec<(u32, String)>,
}

impl Field {
    /// The name of a code.
    pub fn code_name(&self, code: u32) -> Option<&str> {
        let found = self.codes.iter().find(|(known, _)| *known == code);
        found.map(|(_, name)| name.as_str())
    }
}

/// A number on its way from one size to another.
#[derive(Clone, Copy)]
pub(crate) enum Value {
    Whole(i128),
    Real(f64),
}

macro_rules! numbers {
    ($( $number:ident = $ty:ident, $value:ident; )+) => {
        /// A kind of number, with its Rust name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the names say it")]
        pub enum Number { $($number),+ }

        impl Number {
            fn from_name(name: &str) -> Option<Self> {
                match name {
                    $( stringify!($ty) => Some(Self::$number), )+
                    _ => None,
                }
            }

            /// A value in these bytes as text that reads back to it; `None` where they end before
            /// it.
            pub fn text(self, bytes: &[u8]) -> Option<String> {
                Some(match self {
                    $( Self::$number => $ty::from_le_bytes(*bytes.first_chunk()?).to_string(), )+
                })
            }

            pub(crate) fn read(self, bytes: &[u8]) -> Option<Value> {
                Some(match self { $(
                    Self::$number => Value::$value($ty::from_le_bytes(*bytes.first_chunk()?).into()),
                )+ })
            }

            /// Bytes.
            pub fn size(self) -> usize {
                match self { $( Self::$number => size_of::<$ty>(), )+ }
            }
        }
    };
}

numbers! {
    U8 = u8, Whole;
    U16 = u16, Whole;
    U32 = u32, Whole;
    U64 = u64, Whole;
    I8 = i8, Whole;
    I16 = i16, Whole;
    I32 = i32, Whole;
    I64 = i64, Whole;
    F32 = f32, Real;
    F64 = f64, Real;
}

impl Kind {
    /// Bytes.
    pub fn size(&self) -> usize {
        match self {
            Self::Number(number) => number.size(),
            Self::Array(element, count) => element.size().saturating_mul(*count),
            Self::Struct(inner) => inner.size,
        }
    }
}

impl StoredLayout {
    /// Reads a description as [`crate::describe`] writes it; `None` where it makes no sense. No
    /// field of the result leads out of its struct, whatever the text says.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parser = Parser::default();
        text.lines().try_for_each(|line| parser.take(line))?;
        parser.layout()
    }
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
        })
    }
}

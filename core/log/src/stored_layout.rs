//! The layout of a topic's messages as a log describes it: that of the build that wrote the log.

mod ros2msg;
mod table;

use crate::cdr;
use std::sync::Arc;

/// What a topic's messages hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredLayout {
    /// The fixed part.
    pub head: Kind,
    /// One element of what follows it, where something does.
    pub item: Option<Kind>,
    pub(crate) framing: Framing,
}

/// How head and items stand in a message's bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Framing {
    /// One behind the other, as on the bus: so logs had them up to 0.1.0.
    #[default]
    Bus,
    /// As CDR; the items' alignment, bytes.
    Cdr(usize),
}

impl Framing {
    /// Head and items of a message by their sizes; `None` where its bytes are not as many as that.
    pub fn split(self, bytes: &[u8], head: usize, item: usize) -> Option<(&[u8], &[u8])> {
        match self {
            Self::Bus => {
                let (head, items) = bytes.split_at_checked(head)?;
                let is_whole = item == 0 || items.len().is_multiple_of(item);
                is_whole.then_some((head, items))
            }
            Self::Cdr(item_align) => cdr::split(bytes, head, item, item_align),
        }
    }
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
    /// Reads a message definition as [`crate::describe`] writes it; `None` where it makes no
    /// sense. No field of the result leads out of its struct, whatever the text says.
    pub fn parse(text: &str) -> Option<Self> {
        ros2msg::parse(text)
    }

    /// Reads a table as logs carried it up to 0.1.0, likewise.
    pub fn parse_table(text: &str) -> Option<Self> {
        table::parse(text)
    }

    /// Head and items of a message; `None` where its bytes do not fit.
    pub fn split<'a>(&self, bytes: &'a [u8]) -> Option<(&'a [u8], &'a [u8])> {
        let item = self.item.as_ref().map_or(0, Kind::size);
        self.framing.split(bytes, self.head.size(), item)
    }
}

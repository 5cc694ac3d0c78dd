//! A layout as a ROS 2 message definition.

use super::{Field, Framing, Kind, Number, StoredLayout, Struct};
use crate::description::{INSIDE, ITEMS, LAYOUT, NUMBERS, PACKAGE, SEPARATOR, code_name};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A struct and its alignment, bytes.
type Known = (Arc<Struct>, usize);

/// Reads one; `None` where it is none of ours: strings, padding, lengths that are not fixed.
pub(super) fn parse(text: &str) -> Option<StoredLayout> {
    text.starts_with(LAYOUT).then_some(())?;
    let lines: Vec<&str> = text.lines().collect();
    let mut definitions = lines.split(|line| line.starts_with(SEPARATOR));
    let message = definitions.next()?;
    let mut parser = Parser::default();
    for inside in definitions {
        let (name, fields) = inside.split_first()?;
        let name = name.strip_prefix(INSIDE)?.strip_prefix(PACKAGE)?;
        let name = name.strip_prefix('/')?;
        let known = parser.definition(name, fields)?;
        // The first one counts: no struct changes below those that hold it.
        parser.structs.entry(name).or_insert(known);
    }
    // The head's fields, and behind them the items.
    let is_items = |line: &&str| line.ends_with("[] items");
    let items = message.last().filter(|line| is_items(line));
    let fields = match items {
        Some(_) => message.split_last()?.1,
        None => message,
    };
    let (head, _) = parser.definition("", fields)?;
    let item = match items {
        Some(line) => {
            let (kind, name) = line.split_once("[] ")?;
            (name == ITEMS).then_some(())?;
            Some(parser.kind(kind)?)
        }
        None => None,
    };
    // What [`crate::cdr`] relies on.
    (head.size > 0 && head.size.is_multiple_of(8)).then_some(())?;
    let item_align = item.as_ref().map_or(1, |(_, align)| *align);
    Some(StoredLayout {
        head: Kind::Struct(head),
        item: item.map(|(kind, _)| kind),
        framing: Framing::Cdr(item_align),
    })
}

/// The structs that were read so far.
#[derive(Default)]
struct Parser<'a> {
    structs: BTreeMap<&'a str, Known>,
}

impl Parser<'_> {
    /// A struct from the lines of its fields.
    fn definition(&self, name: &str, lines: &[&str]) -> Option<Known> {
        let mut fields = Vec::new();
        let (mut size, mut align) = (0_usize, 1);
        let mut constants: Vec<(u32, &str)> = Vec::new();
        for line in lines.iter().filter(|line| !line.starts_with('#')) {
            let (kind, name) = line.split_once(' ')?;
            (!name.contains(' ')).then_some(())?;
            if let Some((constant, value)) = name.split_once('=') {
                constants.push((value.parse().ok()?, constant));
                continue;
            }
            let codes = constants.drain(..);
            let codes = codes.map(|(code, constant)| Some((code, code_name(name, constant)?)));
            let codes = codes.collect::<Option<Vec<_>>>()?;
            let (kind, field_align) = self.kind(kind)?;
            // Where CDR would pad, bytes and fields are not one another's.
            size.is_multiple_of(field_align).then_some(())?;
            let offset = size;
            size = size.checked_add(kind.size())?;
            align = align.max(field_align);
            let name = name.to_owned();
            fields.push(Field {
                name,
                offset,
                kind,
                codes,
            });
        }
        let is_whole = constants.is_empty() && size.is_multiple_of(align);
        is_whole.then_some(())?;
        let name = name.to_owned();
        let found = Struct { name, fields, size };
        Some((Arc::new(found), align))
    }

    /// A number, a struct, or an array of them, with its alignment.
    fn kind(&self, name: &str) -> Option<(Kind, usize)> {
        if let Some(array) = name.strip_suffix(']') {
            let (element, count) = array.split_once('[')?;
            let (element, align) = self.kind(element)?;
            let count: usize = count.parse().ok()?;
            element.size().checked_mul(count)?;
            return Some((Kind::Array(Box::new(element), count), align));
        }
        if let Some((rust, _)) = NUMBERS.iter().find(|(_, ros)| *ros == name) {
            let number = Number::from_name(rust)?;
            return Some((Kind::Number(number), number.size()));
        }
        let own = name.strip_prefix(PACKAGE)?.strip_prefix('/')?;
        let (found, align) = self.structs.get(own)?;
        Some((Kind::Struct(Arc::clone(found)), *align))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe;
    use randt_messages::layout::Fields;
    use randt_messages::{Layout, Topic, TopicVisitor, visit_log_topics};

    /// Compares the structs of each topic with what their definition says.
    struct Topics;

    impl TopicVisitor for Topics {
        type Error = std::convert::Infallible;

        fn visit<T: Topic>(&mut self) -> Result<(), Self::Error> {
            let layout = StoredLayout::parse(&describe::<T>()).unwrap();
            assert_eq!(layout.head.size(), size_of::<T::Head>(), "{}", T::NAME);
            let item = layout.item.as_ref().map_or(0, Kind::size);
            assert_eq!(item, size_of::<T::Item>(), "{}", T::NAME);
            if item > 0 {
                assert_eq!(layout.framing, Framing::Cdr(align_of::<T::Item>()));
            }
            let Kind::Struct(head) = &layout.head else {
                panic!("{:?}", layout.head);
            };
            let mut own: Vec<(&str, Fields)> = Vec::new();
            T::Head::visit(&mut |name, _, fields| own.push((name, fields)));
            let (_, own) = own.last().unwrap();
            assert_eq!(head.fields.len(), own.len(), "{}", T::NAME);
            for (field, own) in head.fields.iter().zip(*own) {
                assert_eq!((field.name.as_str(), field.offset), (own.name, own.offset));
                let codes = own.codes.iter();
                let codes = codes.map(|(code, name)| (*code, (*name).to_owned()));
                assert!(field.codes.iter().cloned().eq(codes), "{field:?}");
            }
            Ok(())
        }
    }

    #[test]
    fn a_definition_says_where_each_field_is_and_what_its_codes_are_called() {
        visit_log_topics(&mut Topics).unwrap();
    }

    #[test]
    fn a_definition_that_is_none_of_ours_is_refused() {
        let good = "# layout A-0, topic a\nuint64 a\nuint32 B_C_D=3\nuint32 b\nrandt_msgs/E e\n\
            ===\u{3d}\u{3d}\nMSG: randt_msgs/E\nuint16[2] f\n";
        let layout = StoredLayout::parse(good).unwrap();
        let Kind::Struct(head) = &layout.head else {
            panic!("{layout:?}");
        };
        assert_eq!(head.fields[1].codes, [(3, "c-d".to_owned())]);
        for (part, other) in [
            ("# layout", "# about"),
            ("uint64 a", "uint64  a"),
            ("uint64 a", "string a"),
            ("uint64 a", "uint64[] a"),
            ("uint64 a", "uint64[99999999999999999999] a"),
            ("uint64 a", "uint64[9999999999999999999] a"),
            ("B_C_D=3", "C_D=3"),
            ("B_C_D=3", "B_C_D=-3"),
            ("uint32 b", "uint16 b"),
            ("uint32 b\n", ""),
            ("uint16[2] f", "uint16[1] f"),
            ("uint16[2] f", "randt_msgs/E f"),
            ("MSG: randt_msgs/E", "MSG: other/E"),
        ] {
            assert!(good.contains(part));
            assert_eq!(
                StoredLayout::parse(&good.replacen(part, other, 1)),
                None,
                "{other}"
            );
        }
        assert_eq!(StoredLayout::parse(""), None);
    }
}

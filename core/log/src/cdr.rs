//! Our messages as CDR (OMG DDS-XTypes, 7.4): little-endian, each number at a multiple of its
//! size.
//!
//! Payloads are laid out like that already ([`randt_messages::plain!`] refuses padding), so a
//! message is its bytes with what CDR adds: four bytes in front that name the encoding and, where
//! items follow the head, their number. Every reader of ROS 2 messages decodes that.

use randt_messages::{Message, MessageRef, Topic};

/// What CDR begins with: version 1, little-endian, no options. Alignment counts from behind it.
pub(crate) const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];
/// The number of items.
const COUNT: usize = size_of::<u32>();

/// Appends a message.
pub fn write_cdr<T: Topic>(message: MessageRef<'_, T>, out: &mut Vec<u8>) {
    out.extend(ENCAPSULATION);
    out.extend_from_slice(bytemuck::bytes_of(message.head));
    if size_of::<T::Item>() > 0 {
        // `MAX_ITEMS` is far below 2^32.
        out.extend((message.items.len() as u32).to_le_bytes());
        let pad = pad(message.items.len(), align_of::<T::Item>());
        out.resize(out.len() + pad, 0);
        out.extend_from_slice(bytemuck::cast_slice(message.items));
    }
}

/// Bytes that [`write_cdr`] appends.
pub fn cdr_size<T: Topic>(message: MessageRef<'_, T>) -> usize {
    let head = ENCAPSULATION.len() + size_of::<T::Head>();
    match size_of::<T::Item>() {
        0 => head,
        item => {
            let count = message.items.len();
            head + COUNT + pad(count, align_of::<T::Item>()) + count * item
        }
    }
}

/// Reads a message; `None` where the bytes are none of this topic.
pub fn read_cdr<T: Topic>(bytes: &[u8]) -> Option<Message<T>> {
    let [head, item] = [size_of::<T::Head>(), size_of::<T::Item>()];
    let (head, items) = split(bytes, head, item, align_of::<T::Item>())?;
    Message::from_parts(head, items)
}

/// A message's bytes behind what CDR begins with: first comes the head, as it is on the bus.
pub fn cdr_payload(bytes: &[u8]) -> Option<&[u8]> {
    bytes.strip_prefix(&ENCAPSULATION)
}

/// Head and items of a message by their sizes; `None` where its bytes are not as many as that.
pub(crate) fn split(
    bytes: &[u8],
    head: usize,
    item: usize,
    item_align: usize,
) -> Option<(&[u8], &[u8])> {
    let (head, rest) = cdr_payload(bytes)?.split_at_checked(head)?;
    if item == 0 {
        return rest.is_empty().then_some((head, rest));
    }
    let (count, rest) = rest.split_first_chunk()?;
    let count = u32::from_le_bytes(*count) as usize;
    let items = rest.get(pad(count, item_align)..)?;
    (count.checked_mul(item) == Some(items.len())).then_some((head, items))
}

/// Zeros between the number of items and the first one. A head ends at a multiple of eight,
/// because its header holds numbers of eight bytes.
fn pad(count: usize, item_align: usize) -> usize {
    match count {
        0 => 0,
        _ => item_align.saturating_sub(COUNT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{ImuSampleTopic, MapperGraph, RadarScan};

    fn bytes_of<T: Topic>(message: &Message<T>) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_cdr(message.as_ref(), &mut bytes);
        assert_eq!(bytes.len(), cdr_size(message.as_ref()));
        let read = read_cdr::<T>(&bytes).unwrap();
        let on_the_bus = |message: &Message<T>| {
            let mut bytes = Vec::new();
            message.as_ref().write_bytes(&mut bytes);
            bytes
        };
        assert_eq!(on_the_bus(&read), on_the_bus(message));
        bytes
    }

    #[test]
    fn numbers_lie_at_multiples_of_their_size() {
        let mut graph = Message::<MapperGraph>::default();
        let head = size_of_val(&*graph.head);
        assert_eq!(bytes_of(&graph).len(), 4 + head + 4);
        graph.items.resize_with(2, Default::default);
        graph.items[0].a = 7;
        let bytes = bytes_of(&graph);
        assert_eq!(
            bytes[4 + head..][..16],
            [2, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0]
        );
        let mut scan = Message::<RadarScan>::default();
        scan.items.resize_with(3, Default::default);
        assert_eq!(
            bytes_of(&scan).len(),
            4 + size_of_val(&*scan.head) + 4 + 3 * 12
        );
        let sample = Message::<ImuSampleTopic>::default();
        assert_eq!(bytes_of(&sample).len(), 4 + size_of_val(&*sample.head));
    }

    #[test]
    fn what_is_too_short_too_long_or_of_another_encoding_is_no_message() {
        let mut graph = Message::<MapperGraph>::default();
        graph.items.resize_with(2, Default::default);
        let bytes = bytes_of(&graph);
        for length in 0..bytes.len() {
            assert!(
                read_cdr::<MapperGraph>(&bytes[..length]).is_none(),
                "{length}"
            );
        }
        let mut more = bytes.clone();
        more.push(0);
        assert!(read_cdr::<MapperGraph>(&more).is_none());
        let mut big_endian = bytes;
        big_endian[1] = 0;
        assert!(read_cdr::<MapperGraph>(&big_endian).is_none());
    }
}

//! Topics: a name with its version, a fixed head and a slice of items.

use crate::{Header, layout::Layout};
use bytemuck::Pod;

/// One topic of the bus and of the log. A message is one `Head` followed by up to `MAX_ITEMS`
/// items.
pub trait Topic: Copy + core::fmt::Debug + PartialEq + 'static {
    /// Name with version, such as `radar/scan/v1`.
    const NAME: &'static str;
    /// Marker name, a dash and the layout hash of head and item.
    const TYPE_NAME: &'static str;
    /// Most items in one message.
    const MAX_ITEMS: usize;
    /// The fixed part; begins with a [`Header`].
    type Head: Pod + Layout + AsRef<Header> + AsMut<Header>;
    /// One element of the slice, `()` where there is none.
    type Item: Pod + Layout;
}

/// A message that owns its memory. Reuse it: `items` keeps its capacity.
#[derive(Clone, Debug, PartialEq)]
pub struct Message<T: Topic> {
    /// The fixed part.
    pub head: Box<T::Head>,
    /// The slice, at most `T::MAX_ITEMS` long.
    pub items: Vec<T::Item>,
}

/// A message in borrowed memory: shared memory, a log's chunk, an owned [`Message`].
#[derive(Clone, Copy, Debug)]
pub struct MessageRef<'a, T: Topic> {
    /// The fixed part.
    pub head: &'a T::Head,
    /// The slice.
    pub items: &'a [T::Item],
}

impl<T: Topic> Default for Message<T> {
    fn default() -> Self {
        Self {
            head: bytemuck::zeroed_box(),
            items: Vec::new(),
        }
    }
}

impl<T: Topic> Message<T> {
    /// This message, borrowed.
    pub fn as_ref(&self) -> MessageRef<'_, T> {
        MessageRef {
            head: &self.head,
            items: &self.items,
        }
    }

    /// Reads a message from the bytes that [`MessageRef::write_bytes`] made; `None` where their
    /// number does not fit.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (head, items) = bytes.split_at_checked(size_of::<T::Head>())?;
        Self::from_parts(head, items)
    }

    /// The same from the bytes of the head and those of the items, wherever they lie.
    pub fn from_parts(head: &[u8], items: &[u8]) -> Option<Self> {
        let item = size_of::<T::Item>();
        let count = items.len().checked_div(item).unwrap_or(0);
        if head.len() != size_of::<T::Head>() || count * item != items.len() || count > T::MAX_ITEMS
        {
            return None;
        }
        let mut message = Self::default();
        bytemuck::bytes_of_mut(&mut *message.head).copy_from_slice(head);
        if count > 0 {
            message.items = bytemuck::pod_collect_to_vec(items);
        }
        Some(message)
    }
}

impl<'a, T: Topic> MessageRef<'a, T> {
    /// Appends the bytes as they are on the bus: the head, then the items.
    pub fn write_bytes(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(bytemuck::bytes_of(self.head));
        if size_of::<T::Item>() > 0 {
            out.extend_from_slice(bytemuck::cast_slice(self.items));
        }
    }

    /// Sequence number, stamp and epoch.
    pub fn header(&self) -> &'a Header {
        self.head.as_ref()
    }
}

/// Declares a topic: `Marker = "name/v1": Head, [Item; MAX]`. The head's field `header` is a
/// [`Header`](crate::Header).
///
/// ```
/// use randt_messages::{Header, Topic};
///
/// randt_messages::plain! {
///     /// What a wheel has turned.
///     pub struct Wheel {
///         /// The beginning of every message.
///         pub header: Header,
///         /// In all, m.
///         pub turned_m: f64,
///     }
/// }
/// randt_messages::topic! {
///     /// Topic of [`Wheel`].
///     WheelTopic = "example/wheel/v1": Wheel, [(); 0];
/// }
/// assert!(WheelTopic::TYPE_NAME.starts_with("WheelTopic-"));
/// ```
#[macro_export]
macro_rules! topic {
    ($( $(#[$meta:meta])* $marker:ident = $name:literal : $head:ty, [$item:ty; $max:expr]; )+) => { $(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $marker;

        impl $crate::Topic for $marker {
            const NAME: &'static str = $name;
            const TYPE_NAME: &'static str = {
                use $crate::layout::{Layout, hash_u64, type_name_bytes};
                const LENGTH: usize = stringify!($marker).len() + 17;
                const BYTES: [u8; LENGTH] = type_name_bytes(
                    stringify!($marker),
                    hash_u64(<$head as Layout>::HASH, <$item as Layout>::HASH),
                );
                match core::str::from_utf8(&BYTES) { Ok(name) => name, Err(_) => stringify!($marker) }
            };
            const MAX_ITEMS: usize = $max;
            type Head = $head;
            type Item = $item;
        }

        impl AsRef<$crate::Header> for $head {
            fn as_ref(&self) -> &$crate::Header { &self.header }
        }
        impl AsMut<$crate::Header> for $head {
            fn as_mut(&mut self) -> &mut $crate::Header { &mut self.header }
        }
    )+ };
}

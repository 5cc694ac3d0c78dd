//! One message as it goes into the log.

use randt_log::RecordHeader;
use randt_messages::{MessageRef, Topic};

/// A message's bytes, copied from the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raw {
    /// Name of its topic.
    pub topic: &'static str,
    /// Sequence number and times.
    pub label: RecordHeader,
    /// As they were on the bus.
    pub bytes: Vec<u8>,
}

/// Memory that a message takes beyond its bytes.
const OVERHEAD_BYTES: usize = size_of::<Raw>() + 16;

impl Raw {
    /// Copies a message.
    pub fn from_message<T: Topic>(message: MessageRef<'_, T>) -> Self {
        let mut bytes = Vec::with_capacity(size_of::<T::Head>() + size_of_val(message.items));
        message.write_bytes(&mut bytes);
        Self {
            topic: T::NAME,
            label: RecordHeader::from_header(message.header()),
            bytes,
        }
    }

    /// Bytes of memory that it takes.
    pub fn size(&self) -> usize {
        self.bytes.len() + OVERHEAD_BYTES
    }
}

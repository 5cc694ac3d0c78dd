//! One message as it goes into the log.

use randt_log::{RecordHeader, cdr_payload, cdr_size, read_cdr, write_cdr};
use randt_messages::{Message, MessageRef, Topic};

/// A message, copied from the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raw {
    /// Name of its topic.
    pub topic: &'static str,
    /// Sequence number and times.
    pub label: RecordHeader,
    /// As the log has them.
    pub bytes: Vec<u8>,
}

/// Memory that a message takes beyond its bytes.
const OVERHEAD_BYTES: usize = size_of::<Raw>() + 16;

impl Raw {
    /// Copies a message.
    pub fn from_message<T: Topic>(message: MessageRef<'_, T>) -> Self {
        let mut bytes = Vec::with_capacity(cdr_size(message));
        write_cdr(message, &mut bytes);
        Self {
            topic: T::NAME,
            label: RecordHeader::from_header(message.header()),
            bytes,
        }
    }

    /// The message, where it is of this topic.
    pub fn decode<T: Topic>(&self) -> Option<Message<T>> {
        (self.topic == T::NAME).then(|| read_cdr(&self.bytes))?
    }

    /// Its head as it was on the bus, and what follows.
    pub fn head(&self) -> Option<&[u8]> {
        cdr_payload(&self.bytes)
    }

    /// Bytes of memory that it takes.
    pub fn size(&self) -> usize {
        self.bytes.len() + OVERHEAD_BYTES
    }
}

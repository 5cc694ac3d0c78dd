//! One message of a log, still in the reader's memory.

use crate::Error;
use randt_messages::{Message, Topic};

/// A topic as a log declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Name with version.
    pub topic: String,
    /// Type name with layout hash; empty where the log has none.
    pub type_name: String,
    /// How its messages are serialised: `randt` in our logs, `cdr` or `ros1` in ROS bags.
    pub message_encoding: String,
    /// Messages read so far.
    pub messages: u64,
}

/// One message, borrowed from the reader.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'a> {
    /// Its topic and type.
    pub channel: &'a Channel,
    /// Low half of the message's sequence number.
    pub sequence: u32,
    /// The message's stamp.
    pub stamp_ns: i64,
    /// Where the record or chunk that holds it begins in the file.
    pub offset: u64,
    /// The message's bytes as they were on the bus.
    pub bytes: &'a [u8],
    pub(crate) path: &'a str,
    pub(crate) written_by: &'a str,
}

impl Entry<'_> {
    /// The message, `None` where it is of another topic.
    pub fn decode<T: Topic>(&self) -> Result<Option<Message<T>>, Error> {
        if self.channel.topic != T::NAME {
            return Ok(None);
        }
        if self.channel.type_name != T::TYPE_NAME {
            return Err(Error::Layout {
                path: self.path.to_owned(),
                topic: self.channel.topic.clone(),
                found: self.channel.type_name.clone(),
                expected: T::TYPE_NAME,
                written_by: self.written_by.to_owned(),
            });
        }
        match Message::from_bytes(self.bytes) {
            Some(message) => Ok(Some(message)),
            None => Err(Error::MessageSize {
                path: self.path.to_owned(),
                offset: self.offset,
                sequence: self.sequence,
                topic: self.channel.topic.clone(),
                found: self.bytes.len(),
                expected: T::TYPE_NAME,
                head: size_of::<T::Head>(),
                item: size_of::<T::Item>(),
            }),
        }
    }
}

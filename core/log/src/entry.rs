//! One message of a log, still in the reader's memory.

use crate::stored_layout::StoredLayout;
use crate::translation::{OwnLayout, Translation};
use crate::{Error, describe};
use randt_messages::{Message, Topic};
use std::cell::OnceCell;

/// How our messages are serialised, and how their schema is written.
const ENCODING: &str = "randt";
const SCHEMA_ENCODING: &str = "randt-layout";

/// The field that every head begins with.
const HEADER: &str = "header";
/// Where the stamp stands: every head begins with a header.
const STAMP: usize = core::mem::offset_of!(randt_messages::Header, stamp_ns);

/// A topic as a log declares it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// Name with version.
    pub topic: String,
    /// Type name with layout hash; empty where the log has none.
    pub type_name: String,
    /// How its messages are serialised: `randt` for ours, `protobuf` for viewers, `cdr` or `ros1`
    /// in ROS bags.
    pub message_encoding: String,
    /// How the schema is written: `randt-layout`, `protobuf`, `ros2msg`; empty where there is
    /// none.
    pub schema_encoding: String,
    /// What a message holds, for readers that do not know the topic.
    pub schema: Vec<u8>,
    /// Messages read so far.
    pub messages: u64,
}

impl Channel {
    /// The channel of one of our topics.
    pub fn from_topic<T: Topic>() -> Self {
        Self {
            topic: T::NAME.to_owned(),
            type_name: T::TYPE_NAME.to_owned(),
            message_encoding: ENCODING.to_owned(),
            schema_encoding: SCHEMA_ENCODING.to_owned(),
            schema: describe::<T>().into_bytes(),
            messages: 0,
        }
    }

    /// Whether its messages are serialised as they are on our bus.
    pub fn is_ours(&self) -> bool {
        self.message_encoding == ENCODING
    }
}

/// What a log holds of a message beside its bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordHeader {
    /// Low half of the message's sequence number.
    pub sequence: u32,
    /// When it was published; its stamp where that is unknown.
    pub time_ns: i64,
}

impl RecordHeader {
    /// That of one of our messages.
    pub fn from_header(header: &randt_messages::Header) -> Self {
        Self {
            // MCAP has 32 bits for it; the message itself holds all 64.
            sequence: header.sequence as u32,
            time_ns: match header.published_ns {
                0 => header.stamp_ns,
                known => known,
            },
        }
    }
}

/// One message, borrowed from the reader.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'a> {
    /// Its topic and type.
    pub channel: &'a Channel,
    /// Low half of the message's sequence number.
    pub sequence: u32,
    /// When it was published; its stamp where that is unknown.
    pub time_ns: i64,
    /// Where the record or chunk that holds it begins in the file.
    pub offset: u64,
    /// The message's bytes as they were on the bus.
    pub bytes: &'a [u8],
    pub(crate) path: &'a str,
    pub(crate) written_by: &'a str,
    pub(crate) translation: &'a OnceCell<Option<Translation>>,
}

impl Entry<'_> {
    /// The message's own stamp. A message of another encoding is stamped by when it was published.
    pub fn stamp_ns(&self) -> i64 {
        let stamp = self.bytes.get(STAMP..).and_then(|rest| rest.first_chunk());
        match stamp {
            Some(stamp) if self.channel.is_ours() => i64::from_le_bytes(*stamp),
            _ => self.time_ns,
        }
    }

    /// What the log holds of the message beside its bytes.
    pub fn record_header(&self) -> RecordHeader {
        RecordHeader {
            sequence: self.sequence,
            time_ns: self.time_ns,
        }
    }

    /// The message, `None` where it is of another topic.
    pub fn decode<T: Topic>(&self) -> Result<Option<Message<T>>, Error> {
        if self.channel.topic != T::NAME {
            return Ok(None);
        }
        let translated = match self.channel.type_name == T::TYPE_NAME {
            true => None,
            false => self.translation::<T>()?.apply(self.bytes),
        };
        let message = Message::from_bytes(translated.as_deref().unwrap_or(self.bytes));
        message.map(Some).ok_or_else(|| Error::MessageSize {
            path: self.path.to_owned(),
            offset: self.offset,
            sequence: self.sequence,
            topic: self.channel.topic.clone(),
            found: self.bytes.len(),
            expected: T::TYPE_NAME,
            head: size_of::<T::Head>(),
            item: size_of::<T::Item>(),
        })
    }

    /// How messages of the log's layout become those of this build's.
    fn translation<T: Topic>(&self) -> Result<&Translation, Error> {
        let translation = self.translation.get_or_init(|| {
            if self.channel.schema_encoding != SCHEMA_ENCODING {
                return None;
            }
            let stored = std::str::from_utf8(&self.channel.schema).ok()?;
            let own = OwnLayout::from_topic::<T>()?;
            let translation = Translation::between(&StoredLayout::parse(stored)?, &own);
            // A message without its stamp is of no use.
            let mut lacking = translation.lacking.iter();
            let is_message = lacking.all(|name| !name.starts_with(HEADER));
            is_message.then_some(translation)
        });
        translation.as_ref().ok_or_else(|| Error::Layout {
            path: self.path.to_owned(),
            topic: self.channel.topic.clone(),
            found: self.channel.type_name.clone(),
            expected: T::TYPE_NAME,
            written_by: self.written_by.to_owned(),
        })
    }
}

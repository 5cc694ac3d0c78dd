//! One message of a log, still in the reader's memory.

use crate::description::LAYOUT;
use crate::stored_layout::StoredLayout;
use crate::translation::{OwnLayout, Translation};
use crate::{Error, cdr_payload, describe, read_cdr, ros_type};
use randt_messages::{Header, Message, Topic};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// How our messages are serialised, and how their schema is written.
const ENCODING: &str = "cdr";
const SCHEMA_ENCODING: &str = "ros2msg";
/// The same up to 0.1.0: as on the bus, with a table of offsets.
const BUS_ENCODING: &str = "randt";
const TABLE_ENCODING: &str = "randt-layout";

/// The field that every head begins with.
const HEADER: &str = "header";

/// A topic as a log declares it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// Name with version.
    pub topic: String,
    /// Type name; empty where the log has none.
    pub type_name: String,
    /// How its messages are serialised: `cdr` for ours and in ROS 2 bags, `ros1` in others,
    /// `protobuf` for viewers, `randt` for ours up to 0.1.0.
    pub message_encoding: String,
    /// How the schema is written: `ros2msg`, `protobuf`, `randt-layout`; empty where there is
    /// none.
    pub schema_encoding: String,
    /// What a message holds, for readers that do not know the topic.
    pub schema: Vec<u8>,
    /// What else is known of it, such as a ROS publisher's quality of service.
    pub metadata: BTreeMap<String, String>,
    /// Messages read so far.
    pub messages: u64,
}

impl Channel {
    /// The channel of one of our topics.
    pub fn from_topic<T: Topic>() -> Self {
        Self {
            topic: T::NAME.to_owned(),
            type_name: ros_type::<T>(),
            message_encoding: ENCODING.to_owned(),
            schema_encoding: SCHEMA_ENCODING.to_owned(),
            schema: describe::<T>().into_bytes(),
            metadata: BTreeMap::new(),
            messages: 0,
        }
    }

    /// Whether its messages are of our bus, of this build or of another.
    pub fn is_ours(&self) -> bool {
        self.is_of_former_logs() || self.named_layout().is_some()
    }

    /// The name of its messages' layout, with its hash; of those that are not ours their type's.
    pub fn layout(&self) -> &str {
        self.named_layout().unwrap_or(&self.type_name)
    }

    /// How its messages are laid out, where they are ours.
    pub fn stored_layout(&self) -> Option<StoredLayout> {
        let text = std::str::from_utf8(&self.schema).ok()?;
        match self.schema_encoding.as_str() {
            SCHEMA_ENCODING => StoredLayout::parse(text),
            TABLE_ENCODING => StoredLayout::parse_table(text),
            _ => None,
        }
    }

    fn is_of_former_logs(&self) -> bool {
        self.message_encoding == BUS_ENCODING
    }

    fn named_layout(&self) -> Option<&str> {
        (self.message_encoding == ENCODING && self.schema_encoding == SCHEMA_ENCODING)
            .then_some(())?;
        let rest = self.schema.strip_prefix(LAYOUT.as_bytes())?;
        let end = rest.iter().position(|byte| *byte == b',')?;
        std::str::from_utf8(rest.get(..end)?).ok()
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
    pub fn from_header(header: &Header) -> Self {
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
    /// The message's bytes as the log has them.
    pub bytes: &'a [u8],
    pub(crate) path: &'a str,
    pub(crate) written_by: &'a str,
    pub(crate) translation: &'a OnceCell<Option<Translation>>,
}

impl Entry<'_> {
    /// What a message of ours begins with.
    pub fn header(&self) -> Option<Header> {
        let bytes = match self.channel.is_of_former_logs() {
            true => Some(self.bytes),
            false if self.channel.is_ours() => cdr_payload(self.bytes),
            false => None,
        };
        let header = bytes?.get(..size_of::<Header>())?;
        Some(bytemuck::pod_read_unaligned(header))
    }

    /// The message's own stamp. One that is not ours is stamped by when it was published.
    pub fn stamp_ns(&self) -> i64 {
        let header = self.header();
        header.map_or(self.time_ns, |header| header.stamp_ns)
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
        let message = if self.channel.layout() != T::TYPE_NAME {
            let translated = self.translation::<T>()?.apply(self.bytes);
            translated.and_then(|bytes| Message::from_bytes(&bytes))
        } else if self.channel.is_of_former_logs() {
            Message::from_bytes(self.bytes)
        } else {
            read_cdr(self.bytes)
        };
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
            let stored = self.channel.stored_layout()?;
            let own = OwnLayout::from_topic::<T>()?;
            let translation = Translation::between(&stored, &own);
            // A message without its stamp is of no use.
            let mut lacking = translation.lacking.iter();
            let is_message = lacking.all(|name| !name.starts_with(HEADER));
            is_message.then_some(translation)
        });
        translation.as_ref().ok_or_else(|| Error::Layout {
            path: self.path.to_owned(),
            topic: self.channel.topic.clone(),
            found: self.channel.layout().to_owned(),
            expected: T::TYPE_NAME,
            written_by: self.written_by.to_owned(),
        })
    }
}

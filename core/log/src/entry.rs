//! One message of a log, still in the reader's memory.

use crate::translation::{OwnLayout, Translation};
use crate::{Channel, Error, cdr_payload, read_cdr};
use randt_messages::{Header, Message, Topic};
use std::cell::OnceCell;

/// The field that every head begins with.
const HEADER: &str = "header";

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
        let message = if !self.channel.has_layout(T::TYPE_NAME) {
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

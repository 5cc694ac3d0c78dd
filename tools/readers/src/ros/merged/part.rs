//! One file of a recording, read once or, for streams that stand apart in it, several times.

use super::Open;
use crate::ros::compressed::unpack;
use crate::ros::recording::{Channel, Recording};
use crate::{Error, counters::Counters};
use std::path::PathBuf;

/// A stream that is this far behind another one, ns of recording, is looked for in the rest of the
/// file. Less than [`crate::merge`] reads ahead.
const BEHIND_NS: i64 = 500_000_000;

/// One message, with bytes of its own.
#[derive(Debug, Default)]
pub(super) struct Message {
    /// Index into the channels of the whole recording.
    pub channel: usize,
    pub arrival_ns: i64,
    pub offset: u64,
    pub bytes: Vec<u8>,
}

/// A file of a recording.
pub(super) struct Part {
    pub path: PathBuf,
    pub format: &'static str,
    /// When its first message was recorded; the end of time where it has none, the beginning where
    /// it was not asked for yet.
    pub first_ns: i64,
    /// For each of its channels, the index in the whole recording.
    indices: Vec<usize>,
    /// By the whole recording's channels.
    streams: Vec<Stream>,
    /// Opened already, and not read.
    opened: Option<Box<dyn Recording>>,
    /// None before its time has come.
    readers: Vec<Reader>,
    has_begun: bool,
}

/// What was read of a channel in a file.
#[derive(Clone, Debug, Default)]
struct Stream {
    /// Messages that the file says it has, and that were read.
    messages: u64,
    read: u64,
    /// When the last one was recorded, or one that comes later.
    seen_ns: Option<i64>,
}

/// A way through the file.
struct Reader {
    recording: Box<dyn Recording>,
    /// The only channel that is read here; `None`: all that no other reader has.
    only: Option<usize>,
    head: Option<Message>,
    /// When the message before it was recorded.
    before_ns: Option<i64>,
}

impl Part {
    /// Finds the file's topics, which are added to those of the whole recording, and its first
    /// message. The only file of a recording stays open, and begins at once.
    pub fn new(
        path: PathBuf,
        (open, is_only): (Open, bool),
        channels: &mut Vec<Channel>,
        transforms: &mut Vec<Vec<u8>>,
    ) -> Result<Self, Error> {
        let recording = open(&path)?;
        let mut indices = Vec::new();
        let mut streams = Vec::new();
        for channel in recording.channels() {
            let same = |c: &Channel| c.topic == channel.topic && c.type_name == channel.type_name;
            let index = channels.iter().position(same).unwrap_or(channels.len());
            match channels.get_mut(index) {
                Some(known) => known.messages += channel.messages,
                None => channels.push(channel.clone()),
            }
            indices.push(index);
            streams.resize(streams.len().max(index + 1), Stream::default());
            if let Some(stream) = streams.get_mut(index) {
                stream.messages += channel.messages;
            }
        }
        let fixed = recording.static_transforms().iter();
        transforms.extend(fixed.filter_map(|bytes| Some(unpack(bytes).ok()?.into_owned())));
        let format = recording.format();
        let mut opened = Some(recording);
        let mut first_ns = i64::MIN;
        if !is_only && let Some(mut recording) = opened.take() {
            // The reading proper will count the damage.
            let first = recording.next_message(&mut Counters::default())?;
            first_ns = first.map_or(i64::MAX, |raw| raw.arrival_ns);
        }
        Ok(Self {
            first_ns,
            format,
            path,
            indices,
            streams,
            opened,
            readers: Vec::new(),
            has_begun: false,
        })
    }

    /// Whether its time has not come yet.
    pub fn is_closed(&self) -> bool {
        !self.has_begun
    }

    /// Begins to read.
    pub fn begin(
        &mut self,
        open: Open,
        wanted: &[(bool, bool)],
        counters: &mut Counters,
    ) -> Result<(), Error> {
        self.has_begun = true;
        let recording = match self.opened.take() {
            Some(opened) => opened,
            None => open(&self.path)?,
        };
        self.readers.push(Reader {
            recording,
            only: None,
            head: None,
            before_ns: None,
        });
        self.advance(0, Message::default(), wanted, counters)?;
        if let Some((first_ns, _)) = self.earliest() {
            self.first_ns = first_ns;
        }
        Ok(())
    }

    /// When the earliest of its next messages was recorded, and the reader that has it.
    pub fn earliest(&self) -> Option<(i64, usize)> {
        let heads = self.readers.iter().enumerate();
        let heads = heads.filter_map(|(at, reader)| Some((reader.head.as_ref()?.arrival_ns, at)));
        heads.min()
    }

    /// Takes a reader's message, and reads its next one.
    pub fn take(
        &mut self,
        reader: usize,
        into: &mut Message,
        open: Open,
        wanted: &[(bool, bool)],
        counters: &mut Counters,
    ) -> Result<(), Error> {
        let head = self.readers.get_mut(reader).and_then(|r| {
            r.before_ns = r.head.as_ref().map(|head| head.arrival_ns);
            r.head.take()
        });
        let spare = std::mem::replace(into, head.unwrap_or_default());
        self.advance(reader, spare, wanted, counters)?;
        self.split_off_late_streams(reader, open, wanted)
    }

    /// Steps over the next message where it is this one again.
    pub fn drop_repeated(
        &mut self,
        message: &Message,
        wanted: &[(bool, bool)],
        counters: &mut Counters,
    ) -> Result<bool, Error> {
        let is_same = |head: &Message| {
            (head.channel, head.arrival_ns) == (message.channel, message.arrival_ns)
                && head.bytes == message.bytes
        };
        let mut heads = self.readers.iter();
        let Some(at) = heads.position(|reader| reader.head.as_ref().is_some_and(is_same)) else {
            return Ok(false);
        };
        let spare = self.readers.get_mut(at).and_then(|r| r.head.take());
        self.advance(at, spare.unwrap_or_default(), wanted, counters)?;
        Ok(true)
    }

    /// The first messages of channels that have none yet.
    pub fn find_first(&self, open: Open, channels: &[usize], found: &mut [Option<Vec<u8>>]) {
        let Ok(mut recording) = open(&self.path) else {
            return;
        };
        let mut counters = Counters::default();
        let has = |index: &usize| self.streams.get(*index).is_some_and(|s| s.messages > 0);
        let mut missing = channels.iter().filter(|index| has(index)).count();
        while missing > 0
            && let Ok(Some(raw)) = recording.next_message(&mut counters)
        {
            let index = self.indices.get(raw.channel);
            let at = channels.iter().position(|channel| Some(channel) == index);
            if let Some(place) = at.and_then(|at| found.get_mut(at))
                && place.is_none()
                && let Ok(bytes) = unpack(raw.bytes)
            {
                *place = Some(bytes.into_owned());
                missing -= 1;
            }
        }
    }

    /// Counts the damage that only the end showed.
    pub fn close(&mut self, counters: &mut Counters) {
        if let Some(reader) = self.readers.first_mut() {
            reader.recording.close(counters);
        }
    }

    /// Reads a reader's next message that is wanted into its head.
    fn advance(
        &mut self,
        at: usize,
        mut spare: Message,
        wanted: &[(bool, bool)],
        counters: &mut Counters,
    ) -> Result<(), Error> {
        let apart: Vec<usize> = self.readers.iter().filter_map(|r| r.only).collect();
        // The first reader meets all damage.
        let mut unseen = Counters::default();
        let counters = if at == 0 { counters } else { &mut unseen };
        let Some(reader) = self.readers.get_mut(at) else {
            return Ok(());
        };
        while let Some(raw) = reader.recording.next_message(counters)? {
            let index = self.indices.get(raw.channel).copied();
            let is_own = |index: usize| match reader.only {
                Some(only) => only == index,
                None => wanted.get(index).is_some_and(|w| w.0) && !apart.contains(&index),
            };
            let Some(index) = index.filter(|index| is_own(*index)) else {
                continue;
            };
            if let Some(stream) = self.streams.get_mut(index) {
                stream.read += 1;
                stream.seen_ns = Some(raw.arrival_ns);
            }
            spare.bytes.clear();
            match unpack(raw.bytes) {
                Ok(bytes) => spare.bytes.extend_from_slice(&bytes),
                Err(why) => {
                    let (path, offset) = (self.path.display(), raw.offset);
                    counters.count_loss("messages_not_decompressed", 1, || {
                        format!("{path}: at byte {offset}: {why}")
                    });
                    continue;
                }
            }
            (spare.channel, spare.arrival_ns, spare.offset) = (index, raw.arrival_ns, raw.offset);
            reader.head = Some(spare);
            return Ok(());
        }
        if at == 0 {
            reader.recording.close(counters);
        }
        Ok(())
    }

    /// Gives streams that stand behind the one at hand, though recorded before it, a reader of
    /// their own.
    fn split_off_late_streams(
        &mut self,
        reader: usize,
        open: Open,
        wanted: &[(bool, bool)],
    ) -> Result<(), Error> {
        let Some(Reader {
            only: None,
            head: Some(head),
            before_ns: Some(before_ns),
            ..
        }) = self.readers.get(reader)
        else {
            return Ok(());
        };
        // One time of recording alone may be wrong.
        let now_ns = head.arrival_ns.min(*before_ns);
        let (channel, first_ns) = (head.channel, self.first_ns);
        let apart: Vec<usize> = self.readers.iter().filter_map(|r| r.only).collect();
        let is_late = |(index, stream): &(usize, &Stream)| {
            let seen_ns = stream.seen_ns.unwrap_or(first_ns);
            *index != channel
                && !apart.contains(index)
                && wanted.get(*index).is_some_and(|(_, in_order)| *in_order)
                && stream.read < stream.messages
                && now_ns.saturating_sub(seen_ns) > BEHIND_NS
        };
        let streams = self.streams.iter().enumerate();
        let late: Vec<usize> = streams.filter(is_late).map(|(index, _)| index).collect();
        for index in late {
            let mut recording = open(&self.path)?;
            let next_ns = self.skip_to(recording.as_mut(), index)?;
            if next_ns.is_some_and(|next_ns| next_ns < now_ns) {
                let mut own = Reader {
                    recording: open(&self.path)?,
                    only: Some(index),
                    head: None,
                    before_ns: None,
                };
                // Those that were read already.
                let mut read = self.streams.get(index).map_or(0, |stream| stream.read);
                let mut unseen = Counters::default();
                while read > 0
                    && let Some(raw) = own.recording.next_message(&mut unseen)?
                {
                    read -= u64::from(self.indices.get(raw.channel) == Some(&index));
                }
                self.readers.push(own);
                let at = self.readers.len() - 1;
                self.advance(at, Message::default(), wanted, &mut unseen)?;
            } else if let Some(stream) = self.streams.get_mut(index) {
                // It pauses, or its file has fewer messages than it says.
                stream.seen_ns = Some(next_ns.unwrap_or(i64::MAX));
            }
        }
        Ok(())
    }

    /// When the next message of a channel was recorded, behind those that were read already.
    fn skip_to(&self, recording: &mut dyn Recording, index: usize) -> Result<Option<i64>, Error> {
        let mut read = self.streams.get(index).map_or(0, |stream| stream.read);
        let mut unseen = Counters::default();
        while let Some(raw) = recording.next_message(&mut unseen)? {
            if self.indices.get(raw.channel) == Some(&index) {
                if read == 0 {
                    return Ok(Some(raw.arrival_ns));
                }
                read -= 1;
            }
        }
        Ok(None)
    }
}

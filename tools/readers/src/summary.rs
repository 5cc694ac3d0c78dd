//! The summary at the end of an MCAP file: what is in it, and where.

use mcap::records::op;
use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use randt_log::lengths_fit;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Largest plausible record or chunk; it bounds what a hostile length can make us allocate.
const SIZE_MAX: usize = 256 << 20;

/// Bytes of a footer record and the magic behind it, which end every file that was closed.
const FOOTER: u64 = 1 + 8 + 8 + 8 + 4 + 8;

/// Whether the records of the summary can be parsed without asking for more memory than they have.
fn is_sound(file: &mut File, length: u64) -> Option<bool> {
    let end = length.checked_sub(FOOTER)?;
    file.seek(SeekFrom::Start(end)).ok()?;
    let mut footer = [0; FOOTER as usize];
    file.read_exact(&mut footer).ok()?;
    let start = u64::from_le_bytes(*footer.get(9..)?.first_chunk()?);
    let size = end
        .checked_sub(start)
        .filter(|size| start > 0 && *size <= SIZE_MAX as u64)?;
    file.seek(SeekFrom::Start(start)).ok()?;
    let mut section = Vec::new();
    file.take(size).read_to_end(&mut section).ok()?;
    file.seek(SeekFrom::Start(0)).ok()?;

    let mut rest = section.as_slice();
    while let Some((opcode, behind)) = rest.split_first() {
        let (size, behind) = behind.split_first_chunk::<8>()?;
        let size = usize::try_from(u64::from_le_bytes(*size)).ok()?;
        let (content, behind) = behind.split_at_checked(size)?;
        let out_of_place = matches!(*opcode, op::CHUNK | op::ATTACHMENT | op::FOOTER);
        if out_of_place || !lengths_fit(*opcode, content) {
            return Some(false);
        }
        rest = behind;
    }
    Some(true)
}

/// The summary of a file that was closed properly.
pub(crate) struct Summary {
    file: File,
    length: u64,
    summary: mcap::Summary,
}

impl Summary {
    /// `None` where the file has no whole summary, or one that does not name its channels: reading
    /// it through needs none.
    pub fn read(path: &Path) -> Option<Self> {
        let mut file = File::open(path).ok()?;
        let length = file.metadata().ok()?.len();
        if !is_sound(&mut file, length)? {
            return None;
        }
        let options = SummaryReaderOptions::default()
            .with_file_size(length)
            .with_record_length_limit(SIZE_MAX);
        let mut reader = SummaryReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            match event.ok()? {
                SummaryReadEvent::ReadRequest(wanted) => {
                    let read = file.read(reader.insert(wanted)).ok()?;
                    reader.notify_read(read);
                }
                SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to).ok()?),
            }
        }
        let summary = reader.finish()?;
        // Writers need not repeat their channels in the summary, nor count their messages.
        let stats = summary.stats.as_ref()?;
        let counts = &stats.channel_message_counts;
        let counted = counts
            .values()
            .try_fold(0_u64, |sum, n| sum.checked_add(*n));
        let has_channels = counts.keys().all(|id| summary.channels.contains_key(id));
        if !has_channels || counted != Some(stats.message_count) {
            return None;
        }
        Some(Self {
            file,
            length,
            summary,
        })
    }

    /// Topic, type, message encoding and number of messages of each channel, by number.
    pub fn channels(&self) -> Vec<(String, String, String, u64)> {
        let counts = self
            .summary
            .stats
            .as_ref()
            .map(|stats| &stats.channel_message_counts);
        let mut channels: Vec<_> = self.summary.channels.iter().collect();
        channels.sort_by_key(|(number, _)| **number);
        let row = |(number, channel): (&u16, &std::sync::Arc<mcap::Channel<'_>>)| {
            let type_name = channel
                .schema
                .as_ref()
                .map_or("", |schema| schema.name.as_str());
            let messages = counts
                .and_then(|counts| counts.get(number))
                .copied()
                .unwrap_or(0);
            (
                channel.topic.clone(),
                type_name.to_owned(),
                channel.message_encoding.clone(),
                messages,
            )
        };
        channels.into_iter().map(row).collect()
    }

    /// The first `limit` messages of some topics; `None` where an index is wrong.
    pub fn messages_of(&mut self, topics: &[String], limit: usize) -> Option<Vec<Vec<u8>>> {
        let mut messages = Vec::new();
        if topics.is_empty() {
            return Some(messages);
        }
        let options = IndexedReaderOptions::new()
            .include_topics(topics)
            .with_record_length_limit(SIZE_MAX);
        let mut reader = IndexedReader::new_with_options(&self.summary, options).ok()?;
        while let Some(event) = reader.next_event() {
            match event.ok()? {
                IndexedReadEvent::ReadChunkRequest { offset, length } => {
                    if offset.checked_add(length as u64)? > self.length {
                        return None;
                    }
                    let mut chunk = vec![0; length];
                    self.file.seek(SeekFrom::Start(offset)).ok()?;
                    self.file.read_exact(&mut chunk).ok()?;
                    reader.insert_chunk_record_data(offset, &chunk).ok()?;
                }
                IndexedReadEvent::Message { data, .. } => {
                    messages.push(data.to_vec());
                    if messages.len() >= limit {
                        break;
                    }
                }
            }
        }
        Some(messages)
    }
}

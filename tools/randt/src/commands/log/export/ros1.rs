//! A ROS 1 bag (format 2.0), with its indices.

use crate::output::temporary_name;
use crate::ros_topics::{Message, TOPICS, Translator};
use crate::units::count;
use anyhow::Context;
use randt_log::LogReader;
use randt_ros_messages::{Style, time};
use std::fs::{self, File};
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// The bag's header is padded to this, so that it can be written again at the end.
const HEADER_BYTES: usize = 4096;
/// Version of indices.
const VERSION: &[u8] = &[1, 0, 0, 0];
/// A chunk ends when it has more bytes than this, as rosbag's do.
const CHUNK_BYTES: usize = 768 << 10;

/// Writes the bag: under another name until it is whole.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, path: &Path) -> anyhow::Result<String> {
    let part = temporary_name(path);
    let written = write(reader, &part).and_then(|messages| {
        fs::rename(&part, path)?;
        Ok(messages)
    });
    if written.is_err() {
        // Best effort: the first error is what the user needs to see.
        let _ = fs::remove_file(&part);
    }
    let messages = written.with_context(|| format!("{}: cannot be written", path.display()))?;
    Ok(count(messages, "message", "messages"))
}

fn write<R: Read + Seek>(reader: &mut LogReader<R>, path: &Path) -> anyhow::Result<u64> {
    let mut bag = Bag::begin(File::create(path)?)?;
    let mut translator = Translator::new(Style::Ros1, reader.robot()?);
    let mut messages = 0;
    while let Some(entry) = reader.next_entry()? {
        for message in translator.translate(&entry)? {
            bag.add(&message)?;
            messages += 1;
        }
    }
    for message in translator.finish() {
        bag.add(&message)?;
        messages += 1;
    }
    bag.finish()?;
    Ok(messages)
}

/// A bag that is being written.
struct Bag {
    out: BufWriter<File>,
    chunk: Vec<u8>,
    /// Of the chunk, by connection: time and offset of each message.
    index: [Vec<([u8; 8], u32)>; TOPICS.len()],
    infos: Vec<u8>,
    chunks: u32,
    span: Option<([u32; 2], [u32; 2])>,
}

impl Bag {
    fn begin(file: File) -> std::io::Result<Self> {
        let mut out = BufWriter::new(file);
        out.write_all(MAGIC)?;
        out.write_all(&header(0, 0))?;
        Ok(Self {
            out,
            chunk: Vec::new(),
            index: Default::default(),
            infos: Vec::new(),
            chunks: 0,
            span: None,
        })
    }

    fn add(&mut self, message: &Message) -> std::io::Result<()> {
        let topic = TOPICS.iter().position(|topic| topic.name == message.topic);
        let Some((number, index)) = topic.and_then(|t| Some((t, self.index.get_mut(t)?))) else {
            return Ok(());
        };
        if index.is_empty() {
            self.chunk.extend(connection(number));
        }
        let now = time(message.stamp_ns);
        let stamp = bytes_of(now);
        index.push((stamp, self.chunk.len() as u32));
        let number = (number as u32).to_le_bytes();
        let fields: [(&str, &[u8]); 3] = [("op", &[2]), ("conn", &number), ("time", &stamp)];
        self.chunk.extend(record(&fields, &message.bytes));
        let (begin, end) = self.span.unwrap_or((now, now));
        self.span = Some((begin.min(now), end.max(now)));
        if self.chunk.len() > CHUNK_BYTES {
            self.end_chunk()?;
        }
        Ok(())
    }

    fn end_chunk(&mut self) -> std::io::Result<()> {
        let Some((begin, end)) = self.span.take() else {
            return Ok(());
        };
        let at = self.out.stream_position()?.to_le_bytes();
        let size = (self.chunk.len() as u32).to_le_bytes();
        let fields: [(&str, &[u8]); 3] = [("op", &[5]), ("compression", b"none"), ("size", &size)];
        self.out.write_all(&record(&fields, &self.chunk))?;
        self.chunk.clear();
        let mut counts = Vec::new();
        let mut connections = 0_u32;
        for (number, index) in self.index.iter_mut().enumerate() {
            if index.is_empty() {
                continue;
            }
            let number = (number as u32).to_le_bytes();
            let count = (index.len() as u32).to_le_bytes();
            let mut entries = Vec::with_capacity(12 * index.len());
            for (stamp, offset) in index.drain(..) {
                entries.extend(stamp);
                entries.extend(offset.to_le_bytes());
            }
            let fields: [(&str, &[u8]); 4] = [
                ("op", &[4]),
                ("ver", VERSION),
                ("conn", &number),
                ("count", &count),
            ];
            self.out.write_all(&record(&fields, &entries))?;
            counts.extend(number);
            counts.extend(count);
            connections += 1;
        }
        let fields: [(&str, &[u8]); 6] = [
            ("op", &[6]),
            ("ver", VERSION),
            ("chunk_pos", &at),
            ("start_time", &bytes_of(begin)),
            ("end_time", &bytes_of(end)),
            ("count", &connections.to_le_bytes()),
        ];
        self.infos.extend(record(&fields, &counts));
        self.chunks += 1;
        Ok(())
    }

    fn finish(mut self) -> std::io::Result<()> {
        self.end_chunk()?;
        let index_at = self.out.stream_position()?;
        for number in 0..TOPICS.len() {
            self.out.write_all(&connection(number))?;
        }
        self.out.write_all(&self.infos)?;
        self.out.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        self.out.write_all(&header(index_at, self.chunks))?;
        self.out.into_inner()?.sync_all()
    }
}

fn header(index_at: u64, chunks: u32) -> Vec<u8> {
    let connections = TOPICS.len() as u32;
    let fields: [(&str, &[u8]); 4] = [
        ("op", &[3]),
        ("index_pos", &index_at.to_le_bytes()),
        ("conn_count", &connections.to_le_bytes()),
        ("chunk_count", &chunks.to_le_bytes()),
    ];
    let bare = record(&fields, &[]).len();
    record(&fields, &vec![b' '; HEADER_BYTES.saturating_sub(bare)])
}

fn connection(number: usize) -> Vec<u8> {
    let Some(topic) = TOPICS.get(number) else {
        return Vec::new();
    };
    let (kind, topic_name) = (topic.kind, topic.name);
    let type_name = format!("{}/{}", kind.package, kind.name);
    let definition = kind.text(Style::Ros1);
    let mut data = Vec::new();
    for (name, value) in [
        ("topic", topic_name),
        ("type", type_name.as_str()),
        ("md5sum", kind.md5),
        ("message_definition", definition.as_str()),
    ] {
        field(&mut data, name, value.as_bytes());
    }
    if topic.is_latched {
        // `rosbag play` publishes it so that who comes late gets it.
        field(&mut data, "latching", b"1");
    }
    let number = (number as u32).to_le_bytes();
    let fields: [(&str, &[u8]); 3] = [
        ("op", &[7]),
        ("conn", &number),
        ("topic", topic_name.as_bytes()),
    ];
    record(&fields, &data)
}

fn field(out: &mut Vec<u8>, name: &str, value: &[u8]) {
    let length = name.len() + 1 + value.len();
    out.extend((length as u32).to_le_bytes());
    out.extend(name.as_bytes());
    out.push(b'=');
    out.extend(value);
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        field(&mut header, name, value);
    }
    let mut out = (header.len() as u32).to_le_bytes().to_vec();
    out.extend(header);
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out
}

/// Both numbers, the first one first, little-endian.
fn bytes_of([seconds, nanoseconds]: [u32; 2]) -> [u8; 8] {
    (u64::from(nanoseconds) << 32 | u64::from(seconds)).to_le_bytes()
}

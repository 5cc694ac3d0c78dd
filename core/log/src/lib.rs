//! The MCAP log: the messages' bytes as they are on the bus, framed as CDR.
//!
//! Responsible for one container format, written and read: a channel per topic, the layout as a
//! ROS 2 message definition, metadata at the start, damage counted and stepped over, layouts of
//! other builds translated. Not responsible for what the messages mean, nor for when they are
//! written.
//!
//! ```
//! use randt_log::{LogReader, LogWriter, Options};
//! use randt_messages::{ImuSample, ImuSampleTopic, Message};
//! use std::io::Cursor;
//!
//! let mut sample = Message::<ImuSampleTopic>::default();
//! sample.head.header.stamp_ns = 4_000_000;
//! let mut writer = LogWriter::new(Cursor::new(Vec::new()), "example.mcap", Options::default())?;
//! writer.write(sample.as_ref())?;
//! let bytes = writer.finish()?.into_inner();
//!
//! let mut reader = LogReader::new(Cursor::new(bytes), "example.mcap")?;
//! while let Some(entry) = reader.next_entry()? {
//!     if let Some(read) = entry.decode::<ImuSampleTopic>()? {
//!         assert_eq!(read, sample);
//!     }
//! }
//! # Ok::<(), randt_log::Error>(())
//! ```

mod cdr;
mod channel;
mod chunk;
mod copy;
mod damage;
mod date;
mod description;
mod entry;
mod error;
mod file;
mod lengths;
mod reader;
mod record_reader;
mod robot;
mod stored_layout;
mod stream;
mod sums;
mod topics;
mod translation;
mod writer;

pub use cdr::{cdr_payload, cdr_size, read_cdr, write_cdr};
pub use channel::Channel;
pub use copy::copy;
pub use damage::{Damage, DamageKind};
pub use date::{is_date, name_of_date};
pub use description::{describe, ros_type};
pub use entry::{Entry, RecordHeader};
pub use error::Error;
pub use file::LogFile;
pub use lengths::lengths_fit;
pub use mcap::Compression;
pub use reader::LogReader;
pub use robot::{CONFIG_METADATA, CONFIG_TOML, ROBOT_METADATA, Robot};
pub use stored_layout::{Field, Kind, Number, StoredLayout, Struct};
pub use stream::LogStream;
pub use sums::check_sums;
pub use topics::{channel_of, channels};
pub use writer::{ChannelId, LogWriter, Options};

//! A ROS 2 bag in SQLite (db3) as a recording.

use crate::ros::{Channel, Encoding, Kind, Raw, Recording};
use crate::{Error, counters::Counters};
use rusqlite::{Connection, OpenFlags};
use std::path::{Path, PathBuf};

/// First bytes of an SQLite file.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";
/// Messages fetched at a time: a second or two of radar, some megabytes.
const BATCH: i64 = 64;
/// Messages of static transforms that are kept.
const TRANSFORMS_MAX: i64 = 1000;
/// Damaged records after which the rest is given up: each costs SQLite some milliseconds.
const DAMAGE_MAX: u64 = 1000;

/// A database that is being read, in the order in which it was written.
#[derive(Debug)]
pub(crate) struct Database {
    path: PathBuf,
    connection: Connection,
    channels: Vec<Channel>,
    /// Topic number of each channel.
    numbers: Vec<i64>,
    transforms: Vec<Vec<u8>>,
    /// The batch at hand, latest first.
    batch: Vec<Row>,
    present: Vec<u8>,
    /// Number of the last message fetched.
    last: i64,
    damages: u64,
    ended: bool,
}

#[derive(Debug)]
struct Row {
    id: i64,
    topic: i64,
    arrival_ns: i64,
    data: Vec<u8>,
}

impl Database {
    /// Opens a database, for reading only.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let broken = |error: rusqlite::Error| Error::Broken {
            path: path.display().to_string(),
            offset: 0,
            what: format!("not a ROS 2 database: {error}"),
        };
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags).map_err(broken)?;
        let mut database = Self {
            path: path.to_owned(),
            connection,
            channels: Vec::new(),
            numbers: Vec::new(),
            transforms: Vec::new(),
            batch: Vec::new(),
            present: Vec::new(),
            last: i64::MIN,
            damages: 0,
            ended: false,
        };
        database.read_topics().map_err(broken)?;
        // Their absence is noticed where the mounting is.
        database.transforms = database.read_transforms().unwrap_or_default();
        Ok(database)
    }

    fn read_topics(&mut self) -> rusqlite::Result<()> {
        let mut query = self
            .connection
            .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
        let mut rows = query.query([])?;
        while let Some(row) = rows.next()? {
            let (number, topic, type_name): (i64, String, String) =
                (row.get(0)?, row.get(1)?, row.get(2)?);
            let format: String = row.get(3)?;
            let counted = self.connection.query_row(
                "SELECT count(*) FROM messages WHERE topic_id = ?1",
                [number],
                |row| row.get::<_, i64>(0),
            );
            self.numbers.push(number);
            self.channels.push(Channel {
                kind: if format == "cdr" {
                    Kind::from_topic(&topic, &type_name)
                } else {
                    Kind::Other
                },
                topic,
                type_name,
                encoding: Encoding::Cdr,
                // A damaged page hides the count, not the topic.
                messages: counted.map_or(1, |count| count.unsigned_abs()),
            });
        }
        Ok(())
    }

    fn read_transforms(&self) -> rusqlite::Result<Vec<Vec<u8>>> {
        let mut messages = Vec::new();
        let mut query = self
            .connection
            .prepare("SELECT data FROM messages WHERE topic_id = ?1 ORDER BY id LIMIT ?2")?;
        for (channel, number) in self.channels.iter().zip(&self.numbers) {
            if channel.kind == Kind::StaticTransforms {
                let rows = query.query_map([*number, TRANSFORMS_MAX], |row| row.get(0))?;
                messages.extend(rows.filter_map(Result::ok));
            }
        }
        Ok(messages)
    }

    fn fetch(&mut self) -> rusqlite::Result<()> {
        let mut query = self.connection.prepare_cached(
            "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 ORDER BY id LIMIT ?2",
        )?;
        let mut rows = query.query([self.last, BATCH])?;
        while let Some(row) = rows.next()? {
            let id = row.get(0)?;
            if id <= self.last {
                // A damaged page can lead back: such rows were read already.
                return Err(rusqlite::Error::IntegralValueOutOfRange(0, id));
            }
            self.last = id;
            self.batch.push(Row {
                id: self.last,
                topic: row.get(1)?,
                arrival_ns: row.get(2)?,
                data: row.get(3)?,
            });
        }
        Ok(())
    }

    /// Fetches the next messages; over a damaged page by ever longer steps.
    fn fetch_over_damage(&mut self, counters: &mut Counters) {
        let mut step: i64 = 1;
        while self.batch.is_empty() && !self.ended {
            let before = self.last;
            match self.fetch() {
                Ok(()) => self.ended = self.batch.is_empty(),
                Err(error) => {
                    self.damages += 1;
                    let path = self.path.display();
                    counters.count_loss("database_damaged", 1, || {
                        format!("{path}: behind message {before}: {error}")
                    });
                    // What came before the error in this batch is good.
                    if self.batch.is_empty() {
                        self.last = self.last.max(0).saturating_add(step);
                        step = step.saturating_mul(2);
                        self.ended = self.last == i64::MAX || self.damages >= DAMAGE_MAX;
                    }
                }
            }
        }
        self.batch.reverse();
    }
}

impl Recording for Database {
    fn format(&self) -> &'static str {
        "ros2-db3"
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        loop {
            if self.batch.is_empty() {
                self.fetch_over_damage(counters);
            }
            let Some(row) = self.batch.pop() else {
                return Ok(None);
            };
            let Some(channel) = self.numbers.iter().position(|number| *number == row.topic) else {
                let path = self.path.display();
                counters.count_loss("messages_of_unknown_topic", 1, || {
                    format!(
                        "{path}: message {}: topic {} is not declared",
                        row.id, row.topic
                    )
                });
                continue;
            };
            self.present = row.data;
            return Ok(Some(Raw {
                channel,
                arrival_ns: row.arrival_ns,
                offset: row.id.unsigned_abs(),
                bytes: &self.present,
            }));
        }
    }
}

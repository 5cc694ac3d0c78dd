//! One kind of message of a log, in order, once or in a loop.

use crate::Error;
use randt_log::{Entry, LogReader};
use randt_messages::{ImuSampleTopic, Message, RadarScan, Topic};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// A log that begins again does so after this pause: the robot has jumped, and odometry opens a
/// new frame.
const PAUSE_NS: i64 = 2_000_000_000;
/// The emulators begin this long before the log's first stamp: a sweep's first beams lie before
/// it.
const LEAD_NS: i64 = 500_000_000;

/// The messages of one topic of a log.
pub struct Recording<T: Topic> {
    path: PathBuf,
    reader: LogReader<BufReader<File>>,
    endless: bool,
    begin_ns: i64,
    shift_ns: i64,
    last_ns: i64,
    next: Option<Message<T>>,
}

impl<T: Topic> Recording<T> {
    /// Opens a log; refuses one that has no such message. `endless` begins it again at its end.
    pub fn open(path: &Path, endless: bool) -> Result<Self, Error> {
        let (mut first_ns, mut next) = (None, None);
        let mut reader = LogReader::open(path)?;
        while next.is_none()
            && let Some(entry) = reader.next_entry()?
        {
            if is_measured(&entry) {
                first_ns.get_or_insert(entry.stamp_ns());
            }
            next = entry.decode::<T>()?;
        }
        let (Some(first_ns), Some(next)) = (first_ns, next) else {
            let path = path.to_owned();
            let what = T::NAME;
            return Err(Error::Empty { path, what });
        };
        Ok(Self {
            path: path.to_owned(),
            reader,
            endless,
            begin_ns: first_ns.saturating_sub(LEAD_NS),
            shift_ns: 0,
            last_ns: first_ns,
            next: Some(next),
        })
    }

    /// The stamp at which every emulator of this log begins, whatever it sends.
    pub fn begin_ns(&self) -> i64 {
        self.begin_ns
    }

    /// The next message, and what is to be added to its stamps; `None` at the end.
    pub fn next_message(&mut self) -> Result<Option<(Message<T>, i64)>, Error> {
        if self.next.is_none() && self.endless {
            self.begin_again()?;
        }
        let Some(message) = self.next.take() else {
            return Ok(None);
        };
        self.next = self.read()?;
        Ok(Some((message, self.shift_ns)))
    }

    fn read(&mut self) -> Result<Option<Message<T>>, Error> {
        while let Some(entry) = self.reader.next_entry()? {
            // Of both sensors, so that two emulators of one log begin again at the same time.
            if is_measured(&entry) {
                self.last_ns = self.last_ns.max(entry.stamp_ns());
            }
            if let Some(message) = entry.decode::<T>()? {
                return Ok(Some(message));
            }
        }
        Ok(None)
    }

    fn begin_again(&mut self) -> Result<(), Error> {
        let first_ns = self.begin_ns.saturating_add(LEAD_NS);
        let turn_ns = self.last_ns.saturating_sub(first_ns);
        self.shift_ns = self
            .shift_ns
            .saturating_add(turn_ns)
            .saturating_add(PAUSE_NS);
        self.reader = LogReader::open(&self.path)?;
        self.next = self.read()?;
        Ok(())
    }
}

/// Whether a message has the log's own time; what stages published meanwhile may have another
/// clock's.
fn is_measured(entry: &Entry<'_>) -> bool {
    [RadarScan::NAME, ImuSampleTopic::NAME].contains(&entry.channel.topic.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_log::{LogFile, Options};
    use randt_messages::{ImuSample, ImuSampleTopic, MessageRef, RadarScan};

    #[test]
    fn a_log_goes_on_after_its_end_and_a_topic_that_is_not_in_it_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("three.mcap");
        let mut log = LogFile::create(&path, Options::default()).unwrap();
        for i in 0..3 {
            let mut sample = ImuSample::default();
            sample.header.stamp_ns = 7_000_000_000 + i * 4_000_000;
            let (head, items) = (&sample, &[]);
            log.write(MessageRef::<ImuSampleTopic> { head, items })
                .unwrap();
        }
        log.finish().unwrap();
        let mut samples = Recording::<ImuSampleTopic>::open(&path, true).unwrap();
        assert_eq!(samples.begin_ns(), 6_500_000_000);
        let stamps: Vec<i64> = (0..7)
            .map(|_| samples.next_message().unwrap().unwrap())
            .map(|(message, shift_ns)| message.head.header.stamp_ns + shift_ns - 7_000_000_000)
            .collect();
        let again = 2_008_000_000;
        let expected = [
            0,
            4_000_000,
            8_000_000,
            again,
            again + 4_000_000,
            again + 8_000_000,
            2 * again,
        ];
        assert_eq!(stamps, expected);
        let mut once = Recording::<ImuSampleTopic>::open(&path, false).unwrap();
        assert_eq!(
            std::iter::from_fn(|| once.next_message().unwrap()).count(),
            3
        );
        let error = Recording::<RadarScan>::open(&path, false)
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains("three.mcap: no radar/scan/v1 in it"),
            "{error}"
        );
    }
}

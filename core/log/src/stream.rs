//! A log as bytes that only ever grow, for a caller that writes them to the disk itself.

use crate::{Error, LogWriter, Options};
use mcap::write::NoSeek;
use std::io::{self, Seek, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// Puts a log together in memory. What [`LogStream::take`] gives is appended to a file, and
/// nothing that was given is changed later: whatever such a file is cut to, it holds every chunk
/// that ends before the cut.
#[derive(Debug)]
pub struct LogStream {
    writer: LogWriter<NoSeek<Outbox>>,
    outbox: Outbox,
}

/// Bytes on their way out.
#[derive(Clone, Debug, Default)]
struct Outbox(Arc<Mutex<Vec<u8>>>);

impl Outbox {
    fn with<R>(&self, then: impl FnOnce(&mut Vec<u8>) -> R) -> R {
        then(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Outbox {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|waiting| waiting.extend_from_slice(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl LogStream {
    /// Begins a log; `path` is named in errors.
    pub fn new(path: impl Into<String>, options: Options) -> Result<Self, Error> {
        let outbox = Outbox::default();
        let sink = NoSeek::new(outbox.clone());
        Ok(Self {
            writer: LogWriter::with(sink, path, options, true)?,
            outbox,
        })
    }

    /// What writes into it. A chunk that is ended ([`LogWriter::flush`]) comes with the next
    /// [`LogStream::take`].
    pub fn writer(&mut self) -> &mut LogWriter<impl Write + Seek + use<>> {
        &mut self.writer
    }

    /// What is ready to be appended to the file: whole chunks.
    pub fn take(&mut self) -> Vec<u8> {
        self.outbox.with(std::mem::take)
    }

    /// Ends the log and gives the last bytes.
    pub fn finish(self) -> Result<Vec<u8>, Error> {
        self.writer.finish()?;
        Ok(self.outbox.with(std::mem::take))
    }
}

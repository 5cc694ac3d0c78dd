//! A log as a file: written under another name until it is whole.

use crate::{Error, LogWriter, Options};
use randt_messages::{MessageRef, Topic};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A log file in the making: `NAME.active` until [`LogFile::finish`] gives it its name.
///
/// Dropped before that, it takes the `.active` file with it. A process that is killed leaves it,
/// and [`crate::LogReader`] reads it up to the cut.
#[derive(Debug)]
pub struct LogFile {
    writer: LogWriter<BufWriter<File>>,
    active: Active,
    path: PathBuf,
}

/// The file under its temporary name; removed with this unless it has got its own.
#[derive(Debug)]
struct Active {
    path: PathBuf,
    renamed: bool,
}

impl Drop for Active {
    fn drop(&mut self) {
        if !self.renamed {
            // Best effort: whatever ended the log early is the error that counts.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl LogFile {
    /// Begins the file; an older `.active` one of the same name is overwritten.
    pub fn create(path: &Path, options: Options) -> Result<Self, Error> {
        Self::create_under(path, ".active", options)
    }

    /// Begins a copy: `NAME.part` until it is finished, because `NAME.active` may be what is
    /// copied.
    pub fn create_copy(path: &Path, options: Options) -> Result<Self, Error> {
        Self::create_under(path, ".part", options)
    }

    fn create_under(path: &Path, ending: &str, options: Options) -> Result<Self, Error> {
        let mut name = OsString::from(path);
        name.push(ending);
        let active = PathBuf::from(name);
        let shown = active.display().to_string();
        let file = File::create(&active).map_err(Error::io(&*shown))?;
        Ok(Self {
            writer: LogWriter::new(BufWriter::with_capacity(1 << 18, file), shown, options)?,
            active: Active {
                path: active,
                renamed: false,
            },
            path: path.to_owned(),
        })
    }

    /// See [`LogWriter::write_metadata`].
    pub fn write_metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), Error> {
        self.writer.write_metadata(name, metadata)
    }

    /// See [`LogWriter::write`].
    pub fn write<T: Topic>(&mut self, message: MessageRef<'_, T>) -> Result<(), Error> {
        self.writer.write(message)
    }

    /// What writes into it, for channels of any encoding.
    pub fn writer(&mut self) -> &mut LogWriter<impl std::io::Write + std::io::Seek + use<>> {
        &mut self.writer
    }

    /// Ends the log, brings it to the disk and gives it its name. Returns its size in bytes.
    pub fn finish(self) -> Result<u64, Error> {
        let Self {
            writer,
            mut active,
            path,
        } = self;
        let shown = |cause| Error::io(path.display().to_string())(cause);
        let file = writer.finish()?.into_inner();
        let file = file.map_err(|error| shown(error.into_error()))?;
        file.sync_data().map_err(shown)?;
        let size = file.metadata().map_err(shown)?.len();
        std::fs::rename(&active.path, &path).map_err(shown)?;
        active.renamed = true;
        Ok(size)
    }
}

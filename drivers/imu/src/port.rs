//! An open serial port.
//!
//! Responsible for opening, for the text where that fails, and for bytes. Not responsible for
//! when.
//!
//! The crate serialport sets the port up. Bytes go through a descriptor of our own: serialport's
//! cannot be slept on without unsafe code.

use rustix::fs::OFlags;
use serialport::{ClearBuffer, SerialPort, TTYPort};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, IsTerminal, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

/// Bytes that the kernel keeps for a reader: N_TTY_BUF_SIZE. It drops what comes beyond them.
pub(crate) const KERNEL_BUFFER: usize = 4096;
/// Another program reads it.
const TAKEN: &str = "another program has it open";

/// A serial port, open, raw, at its speed, ours alone. Reads and writes do not wait.
#[derive(Debug)]
pub(crate) struct Port {
    bytes: File,
    /// Has set the port up, and keeps others from opening it: also root, by a lock, where it asks
    /// for it.
    _settings: TTYPort,
}

impl Port {
    /// Opens it, or gives the reason why not.
    pub(crate) fn open(path: &Path, baud: u32) -> Result<Self, String> {
        let at_path = |why: &str| format!("{}: {why}", path.display());
        let failed = |error: &io::Error| at_path(&plain(error));
        let kind = fs::metadata(path)
            .map_err(|error| failed(&error))?
            .file_type();
        if !kind.is_char_device() {
            let kind = match kind {
                _ if kind.is_dir() => "is a directory, not a serial port",
                _ if kind.is_file() => "is a file, not a serial port",
                _ => "is no serial port",
            };
            return Err(at_path(kind));
        }
        let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
        let bytes = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits() as i32)
            .open(path)
            .map_err(|error| failed(&error))?;
        if !bytes.is_terminal() {
            return Err(at_path("is another device, not a serial port"));
        }
        let settings = serialport::new(path.to_string_lossy(), baud)
            .open_native()
            // The age of what lies there is unknown.
            .and_then(|settings| settings.clear(ClearBuffer::Input).map(|()| settings));
        Ok(Self {
            bytes,
            _settings: settings.map_err(|error| at_path(&settings_failed(&error)))?,
        })
    }

    /// Reads what is there; none where nothing is. An end is an error: the device is gone.
    pub(crate) fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        match self.bytes.read(bytes) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(Some(count)),
            Err(error) if is_nothing(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Writes what there is room for; a command is sent again where it is not answered.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.bytes.write(bytes) {
            Err(error) if !is_nothing(&error) => Err(error),
            _ => Ok(()),
        }
    }

    /// What to sleep on.
    pub(crate) fn descriptor(&self) -> BorrowedFd<'_> {
        self.bytes.as_fd()
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Why a port cannot be opened.
fn plain(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "not there; trying again".to_owned(),
        ErrorKind::PermissionDenied => {
            "no permission; is the user in the group dialout?".to_owned()
        }
        ErrorKind::ResourceBusy => TAKEN.to_owned(),
        // ENXIO, ENODEV, EIO: a device that is just going or coming.
        _ => format!("{error}; trying again"),
    }
}

fn settings_failed(error: &serialport::Error) -> String {
    match error.kind() {
        serialport::ErrorKind::NoDevice => TAKEN.to_owned(),
        serialport::ErrorKind::Io(kind) => plain(&kind.into()),
        _ => format!("cannot be set up: {error}; trying again"),
    }
}

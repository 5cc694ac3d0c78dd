//! A pseudo-terminal that stands for a serial port.

use crate::Error;
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

/// A pseudo-terminal: the device's end here, the host's at [`Terminal::path`].
#[derive(Debug)]
pub(super) struct Terminal {
    device: File,
    /// Kept open, so that a host that closes the port does not end it.
    host: File,
    path: PathBuf,
}

impl Terminal {
    /// Opens one, which the kernel names.
    pub(super) fn open() -> Result<Self, Error> {
        Self::plug().map_err(Error::io("a pseudo-terminal"))
    }

    fn plug() -> io::Result<Self> {
        let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&device)?;
        unlockpt(&device)?;
        let name = ptsname(&device, Vec::new())?;
        let path = PathBuf::from(std::ffi::OsString::from_vec(name.into_bytes()));
        let host = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(OFlags::NOCTTY.bits() as i32)
            .open(&path)?;
        // Else it would echo what is sent before the host sets it up.
        let mut settings = tcgetattr(&host)?;
        settings.make_raw();
        tcsetattr(&host, OptionalActions::Now, &settings)?;
        fcntl_setfl(&device, OFlags::RDWR | OFlags::NONBLOCK)?;
        Ok(Self {
            device: device.into(),
            host,
            path,
        })
    }

    /// The host's end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What the host sent.
    pub(super) fn read(&mut self) -> Vec<u8> {
        // A host that had the port for itself unlocks it by closing it, unless it is open
        // elsewhere too: here it is.
        let _ = ioctl_tiocnxcl(&self.host);
        let mut bytes = vec![0; 1024];
        let count = self.device.read(&mut bytes).unwrap_or_default();
        bytes.truncate(count);
        bytes
    }

    /// Sends; what the host does not fetch is lost, as on a wire.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        let is_interrupted = |error: io::Error| error.kind() == ErrorKind::Interrupted;
        while self.device.write(bytes).is_err_and(is_interrupted) {}
    }
}

/// Lets a link point to a terminal, whatever it pointed to before.
pub(super) fn link(link: &Path, terminal: &Path) -> Result<(), Error> {
    // A file that is no link is not ours to replace.
    if fs::symlink_metadata(link).is_ok_and(|there| !there.is_symlink()) {
        return Err(Error::Taken(link.to_owned()));
    }
    let mut part = link.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let _ = fs::remove_file(&part);
    symlink(terminal, &part)
        .and_then(|()| fs::rename(&part, link))
        .map_err(Error::io(link.display().to_string()))
}

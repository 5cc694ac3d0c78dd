//! Lines for the journal: with fields where it is connected, else plain on standard error.

use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixDatagram;

/// Where journald takes entries in its own protocol.
const SOCKET: &str = "/run/systemd/journal/socket";

/// The priority of a line, by syslog's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Priority {
    /// Something failed.
    Error = 3,
    /// The operator should know.
    Warning = 4,
    /// Normal operation.
    Info = 6,
}

/// The message that a stage sent last when it wrote a line: its process's epoch, and the message's
/// number. With these a line is found in a log of the topics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LastMessage {
    pub epoch: u64,
    pub sequence: Option<u64>,
}

/// The connection to the journal.
#[derive(Debug)]
pub(crate) struct Journal {
    stage: String,
    socket: Option<UnixDatagram>,
}

impl Journal {
    /// That of a stage. The journal is used if standard error is connected to it: a stage whose
    /// output was redirected writes there.
    pub(crate) fn open(stage: &str) -> Self {
        let socket = is_connected().then(|| {
            let socket = UnixDatagram::unbound().ok()?;
            socket.connect(SOCKET).ok()?;
            // What the journal cannot take at once goes to standard error.
            socket.set_nonblocking(true).ok()?;
            Some(socket)
        });
        Self {
            stage: stage.to_owned(),
            socket: socket.flatten(),
        }
    }

    /// Writes a line or several.
    pub(crate) fn log(&self, priority: Priority, last: LastMessage, text: &str) {
        let sent = self.socket.as_ref().and_then(|socket| {
            let entry = entry(&self.stage, priority, last, text);
            socket.send(&entry).ok()
        });
        if sent.is_none() {
            log_to_stderr(&self.stage, priority, text);
        }
    }
}

/// Writes to standard error, with the priority in front if that leads to the journal. The last
/// lines of a process go this way: the journal no longer knows the unit of an entry whose sender
/// is gone, but it knows that of standard error.
pub(crate) fn log_to_stderr(stage: &str, priority: Priority, text: &str) {
    let mut lines = String::new();
    if is_connected() {
        for line in text.lines() {
            lines += &format!("<{}>{line}\n", priority as u8);
        }
    } else {
        lines = format!("randt-{stage}: {text}\n");
    }
    // A stage goes on if standard error is closed.
    let _ = std::io::stderr().write_all(lines.as_bytes());
}

/// Whether standard error is the journal's, as systemd names it: JOURNAL_STREAM is device and
/// inode.
fn is_connected() -> bool {
    let Ok(named) = std::env::var("JOURNAL_STREAM") else {
        return false;
    };
    let opened = std::fs::metadata("/proc/self/fd/2");
    opened.is_ok_and(|opened| named == format!("{}:{}", opened.dev(), opened.ino()))
}

/// An entry in journald's protocol. The text has its length before it, so that it may have several
/// lines.
fn entry(stage: &str, priority: Priority, last: LastMessage, text: &str) -> Vec<u8> {
    let mut fields = format!(
        "PRIORITY={}\nSYSLOG_IDENTIFIER=randt-{stage}\nRANDT_STAGE={stage}\nRANDT_EPOCH={}\n",
        priority as u8, last.epoch
    );
    if let Some(sequence) = last.sequence {
        fields += &format!("RANDT_SEQUENCE={sequence}\n");
    }
    fields += "MESSAGE\n";
    let mut entry = fields.into_bytes();
    entry.extend((text.len() as u64).to_le_bytes());
    entry.extend(text.as_bytes());
    entry.push(b'\n');
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_has_the_fields_and_a_text_of_any_lines() {
        let last = LastMessage {
            epoch: 7,
            sequence: Some(3),
        };
        let entry = entry("filter", Priority::Warning, last, "a\nb");
        let expected =
            b"PRIORITY=4\nSYSLOG_IDENTIFIER=randt-filter\nRANDT_STAGE=filter\nRANDT_EPOCH=7\n\
              RANDT_SEQUENCE=3\nMESSAGE\n\x03\0\0\0\0\0\0\0a\nb\n";
        assert_eq!(entry, expected);
    }
}

//! Wakes the stage from RustDDS's threads.

use std::io::{PipeReader, PipeWriter, Read, Write, pipe};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Wake, Waker};

/// A pipe that has a byte in it as long as something has come.
pub struct Bell {
    reader: PipeReader,
    hammer: Arc<Hammer>,
}

struct Hammer {
    writer: PipeWriter,
    has_rung: AtomicBool,
}

impl Bell {
    /// One that has not rung.
    pub fn new() -> std::io::Result<Self> {
        let (reader, writer) = pipe()?;
        let has_rung = AtomicBool::new(false);
        let hammer = Arc::new(Hammer { writer, has_rung });
        Ok(Self { reader, hammer })
    }

    /// What rings it.
    pub fn waker(&self) -> Waker {
        Waker::from(Arc::clone(&self.hammer))
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.reader.as_fd()
    }

    /// Lets it ring anew: before what has come is taken.
    pub fn hush(&mut self) -> std::io::Result<()> {
        if self.hammer.has_rung.swap(false, Ordering::AcqRel) {
            // The byte is there, or will be in a moment.
            self.reader.read_exact(&mut [0])?;
        }
        Ok(())
    }
}

impl Wake for Hammer {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        if !self.has_rung.swap(true, Ordering::AcqRel) {
            // It fails where the stage has ended.
            let _ = (&self.writer).write(&[1]);
        }
    }
}

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

/// Whether anything has come to one of those that ring it.
#[derive(Clone)]
pub struct Rope(Arc<Pulled>);

struct Pulled {
    hammer: Arc<Hammer>,
    is_pulled: AtomicBool,
}

impl Bell {
    /// One that has not rung.
    pub fn new() -> std::io::Result<Self> {
        let (reader, writer) = pipe()?;
        let has_rung = AtomicBool::new(false);
        let hammer = Arc::new(Hammer { writer, has_rung });
        Ok(Self { reader, hammer })
    }

    /// Something to ring it by; it counts as pulled.
    pub fn rope(&self) -> Rope {
        Rope(Arc::new(Pulled {
            hammer: Arc::clone(&self.hammer),
            is_pulled: AtomicBool::new(true),
        }))
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

impl Rope {
    /// What pulls it, once.
    pub fn waker(&self) -> Waker {
        Waker::from(Arc::clone(&self.0))
    }

    /// Whether it was pulled since the last time.
    pub fn was_pulled(&self) -> bool {
        self.0.is_pulled.swap(false, Ordering::AcqRel)
    }
}

impl Wake for Pulled {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.is_pulled.store(true, Ordering::Release);
        if !self.hammer.has_rung.swap(true, Ordering::AcqRel) {
            // It fails where the stage has ended.
            let _ = (&self.hammer.writer).write(&[1]);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    #[test]
    fn it_rings_once_until_it_is_hushed_and_knows_who_rang() {
        let mut bell = Bell::new().unwrap();
        let [one, other] = [bell.rope(), bell.rope()];
        assert!(one.was_pulled() && other.was_pulled() && !one.was_pulled());
        one.waker().wake();
        one.waker().wake();
        assert!(one.was_pulled() && !other.was_pulled());
        bell.hush().unwrap();
        // Nothing is left that would be read.
        bell.hush().unwrap();
        other.waker().wake();
        assert!(other.was_pulled());
    }
}
